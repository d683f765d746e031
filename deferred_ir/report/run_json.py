"""RUN.json: what was rendered, on what, how long each pass took and what was left out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from deferred_ir.engine.measurement import Measurement
from deferred_ir.graph.file import graph_hash
from deferred_ir.graph.graph import Graph, Plan
from deferred_ir.report import left_out as savings
from deferred_ir.report import lost_light
from deferred_ir.scene.motion import FRAMES_PER_SECOND
from deferred_ir.scene.scene import Scene

if TYPE_CHECKING:
    from deferred_ir.engine.renderer import Renderer


def run_record(
    renderer: Renderer,
    scene: Scene,
    graph_name: str,
    graph: Graph,
    plan: Plan,
    *,
    seed: int,
    measurement: Measurement,
    accumulated: int = 1,
) -> dict[str, Any]:
    """The record of a run as plain data, in the order of the contract. accumulated: frames averaged in an image."""
    casting = graph.nodes.get("vpl")
    last = measurement.counters[-1]
    passes: list[dict[str, Any]] = [dict(entry) for entry in measurement.passes()]
    for entry in passes:
        step = next((step for step in plan.steps if step.name == entry["name"]), None)
        if step and (subpasses := step.work.subpasses(step.descriptions, renderer.executor.state(step.name))):
            entry["subpasses"] = [dict(subpass) for subpass in subpasses]
    memory = renderer.memory()
    left_out = [*savings.of_scene(scene), *savings.of_frames(renderer, plan, measurement)]
    lost = lost_light.estimate_for(plan, renderer.tracer)
    # Last, for it draws over what the frames have left.
    time = (len(measurement.frame_ms) - 1) / FRAMES_PER_SECOND if scene.moves else 0.0
    left_out += savings.of_passes(renderer, scene.at(time), plan, seed=seed)
    return {
        "scene": scene.name,
        "scene_hash": scene.hash,
        "chosen": dict(scene.chosen),
        "graph": graph_name,
        "graph_hash": graph_hash(graph),
        "size": list(renderer.size),
        "vpls": getattr(casting.work.params, "count", 0) if casting else 0,
        "vpls_alive": last.get("vpls_alive", 0),
        "seed": seed,
        "device": renderer.gpu.device.name,
        "frames": len(measurement.frame_ms),
        "time": time,
        "accumulated": accumulated,
        "frame_ms": measurement.median_frame_ms(),
        "passes": passes,
        "maps_drawn": [counters.get("maps_drawn", 0) for counters in measurement.counters],
        "stand_in": _stand_in(last),
        "left_out": [asdict(entry) for entry in left_out],
        "bias": lost,
        "memory_bytes": memory,
    }


def _stand_in(counters: Mapping[str, int]) -> dict[str, int] | None:
    """Triangles and bytes of the mesh that maps of VPLs drew, None where it was the scene's own."""
    names = ("triangles", "bytes")
    return {name: counters[f"stand_in_{name}"] for name in names} if "stand_in_bytes" in counters else None
