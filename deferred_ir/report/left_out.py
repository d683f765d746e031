"""What a run left out, why, and what that saved where it is measured: milliseconds of a frame, bytes on the device."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING

from deferred_ir.base.errors import DeviceError, GraphError
from deferred_ir.engine.measurement import Measurement
from deferred_ir.graph.graph import Plan
from deferred_ir.graph.ports import Texture
from deferred_ir.scene.scene import Scene

if TYPE_CHECKING:
    from deferred_ir.engine.renderer import Renderer

TURNS = 3
"""How often each pass that was left out is run to measure it."""


@dataclass(frozen=True)
class LeftOut:
    """What was left out, and why. ms: median GPU time of a frame; bytes: on the device; None: not measured."""

    what: str
    why: str
    ms: float | None = None
    bytes: int | None = None


def list_for_scene(scene: Scene) -> list[LeftOut]:
    """List the vertex attributes, and the code that reads them, that this scene does not need."""
    g = scene.geometry
    vertices = len(g.positions)
    textured = {material.base_color_texture is not None for material in scene.materials}
    found = [
        (g.normals is None, LeftOut("vertex normals", "the scene has none", bytes=12 * vertices)),
        (g.colors is None, LeftOut("vertex colours", "the scene has none", bytes=12 * vertices)),
        (not scene.textures, LeftOut("textures", "the scene has none", bytes=8 * vertices)),
        (textured == {True}, LeftOut("faces without a texture", "the scene has none")),
        (len(scene.materials) == 1, LeftOut("a material for each face", "the scene has one")),
        (
            not any(light.has_area for light in scene.direct_lights),
            LeftOut("soft shadows", "the spotlight's radius is 0"),
        ),
    ]
    return [entry for absent, entry in found if absent]


def list_for_frames(renderer: Renderer, plan: Plan, measurement: Measurement) -> list[LeftOut]:
    """List what the frames of `measurement` did without. It reads what the last of them has left on the device."""
    executor, frames, last = renderer.executor, len(measurement.skipped), measurement.counters[-1]
    found = [
        LeftOut(name, f"in {n} of {frames} frames nothing that it is made of changed", ms)
        for name, n, ms in measurement.skipped_passes()
    ]
    for figure in dict.fromkeys(figure for step in plan.steps for figure in step.work.figures):
        if figure.left_out and (n := last.get(figure.name, 0)):
            what, why = (text.format(n=n) for text in figure.left_out)
            found.append(LeftOut(what, why))
    if renderer.embree_seconds == 0:
        found.append(LeftOut("Embree's scene", "no ray was traced"))
    for step in plan.steps:
        for port, output in step.outputs.items():
            described = output.description
            if not isinstance(described, Texture) or not described.grows:
                continue
            texture = executor.resource((step.name, port))
            if texture.layers < described.layers:
                why = f"{texture.layers} of {described.layers} layers are enough for the lights that live"
                spared = texture.nbytes // texture.layers * (described.layers - texture.layers)
                found.append(LeftOut(f"{step.name}.{port}", why, bytes=spared))
    nbytes = executor.allocation.nbytes()
    for source, home in executor.allocation.aliases.items():
        why = f"it has the texture of {'.'.join(home)}, which nothing reads any more"
        found.append(LeftOut(".".join(source), why, bytes=nbytes[".".join(home)]))
    return found


def measure_passes(
    renderer: Renderer, scene: Scene, plan: Plan, *, vpls: int | None = None, seed: int = 0
) -> list[LeftOut]:
    """Measure the passes and targets that `plan` does without, by running those that another scene or output needs.

    Call it when all frames are drawn and read: it draws into their textures. Those that cannot run here, for example
    since their maps would not fit, are listed without figures.
    """
    ms, nbytes = dict[str, float](), dict[str, int]()
    if plan.left_out:
        with suppress(DeviceError, GraphError):
            ms = _time_passes(renderer, scene, plan, vpls=vpls, seed=seed)
            nbytes = renderer.executor.allocation.nbytes()
    return [LeftOut(name, why, ms.get(name), nbytes.get(name)) for name, why in plan.left_out.items()]


def _time_passes(renderer: Renderer, scene: Scene, plan: Plan, *, vpls: int | None, seed: int) -> dict[str, float]:
    """Measure each pass that runs with `keep_all` and not in `plan`. Returns GPU time in ms by name."""
    full = renderer.plan(scene, vpls, keep_all=True)
    extra = {step.name for step in full.steps} - {step.name for step in plan.steps}
    measurement, reuse, renderer.reuse = Measurement(), renderer.reuse, False
    try:
        for turn in range(1 + TURNS):
            renderer.draw(scene, full, seed=seed, steps=extra, measurement=measurement if turn else None)
        renderer.finish(measurement)
    finally:
        renderer.reuse = reuse
    return {str(entry["name"]): float(entry["gpu_ms"]) for entry in measurement.passes()}
