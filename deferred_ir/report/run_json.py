"""RUN.json: what was rendered, on what, how long each pass took and what was left out. Describing draws nothing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from deferred_ir.engine.error_estimate import Estimate
from deferred_ir.engine.measurement import Measurement
from deferred_ir.engine.settings import VPLS
from deferred_ir.graph.figures import Figure
from deferred_ir.graph.file import graph_hash, list_figures
from deferred_ir.graph.graph import Graph, Plan
from deferred_ir.graph.roles import find_parameters
from deferred_ir.report.left_out import LeftOut, list_for_frames, list_for_scene
from deferred_ir.report.shared_errors import list_shared_errors
from deferred_ir.scene.motion import FRAMES_PER_SECOND
from deferred_ir.scene.scene import Scene

if TYPE_CHECKING:
    from deferred_ir.engine.renderer import Renderer


def describe_run(
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
    """Return what RUN.json holds, in the order of the contract, from what the frames have left on the device.

    accumulated: frames averaged in an image. `add_measurements` adds what takes work of its own.
    """
    passes: list[dict[str, Any]] = [dict(entry) for entry in measurement.passes()]
    stages = renderer.executor.stages()
    for entry in passes:
        step = next((step for step in plan.steps if step.name == entry["name"]), None)
        if step and (subpasses := step.work.subpasses(step.descriptions, renderer.executor.state(step.name))):
            entry["subpasses"] = [dict(subpass) for subpass in subpasses]
        if stage := stages.get(str(entry["name"])):
            entry["stage"] = stage
    left_out = [*list_for_scene(scene), *list_for_frames(renderer, plan, measurement)]
    return {
        "scene": scene.name,
        "scene_hash": scene.hash,
        "chosen": dict(scene.chosen),
        "graph": graph_name,
        "graph_hash": graph_hash(graph),
        "set": dict(renderer.setup.set),
        "size": list(renderer.size),
        "vpls": max(find_parameters(graph, VPLS).values(), default=0),
        "seed": seed,
        "device": renderer.gpu.device.name,
        "frames": len(measurement.frame_ms),
        "time": (len(measurement.frame_ms) - 1) / FRAMES_PER_SECOND if scene.moves else 0.0,
        "accumulated": accumulated,
        "error": None,
        "within": None,
        "frame_ms": measurement.median_frame_ms(),
        "passes": passes,
        **_read_figures(list_figures(graph), measurement.counters),
        "left_out": [asdict(entry) for entry in left_out],
        "bias": None,
        "memory_bytes": renderer.memory(),
    }


def describe_error(estimate: Estimate, plan: Plan, *, target: float | None) -> dict[str, Any]:
    """Return what RUN.json holds of the error of an averaged image: what was asked for, and what its frames tell.

    shared: what they cannot tell, since all get it wrong alike; clamp and cones are measured under `bias`.
    """
    return {
        "target": target,
        "estimate": estimate.error,
        "noise": estimate.noise,
        "filter": estimate.filter,
        "filtered_share": estimate.share,
        "shared": list_shared_errors(plan),
    }


def add_measurements(run: dict[str, Any], *, bias: Mapping[str, float] | None, passes: Sequence[LeftOut]) -> None:
    """Add to a described run what was measured after its frames: lost light, and the passes that were left out."""
    run["bias"] = None if bias is None else dict(bias)
    run["left_out"] += [asdict(entry) for entry in passes]


def _read_figures(figures: Sequence[Figure], frames: Sequence[Mapping[str, int]]) -> dict[str, Any]:
    """Put the figures in their places in RUN.json. frames: what was published with each, by name."""
    result: dict[str, Any] = {}
    for figure in figures:
        last = frames[-1].get(figure.name)
        match figure.key:
            case (key,):
                result[key] = [frame.get(figure.name, 0) for frame in frames] if figure.each_frame else last or 0
            case (table, key):
                result.setdefault(table, None)
                if last is not None:
                    result[table] = {**(result[table] or {}), key: last}
    return result
