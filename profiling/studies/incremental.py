"""What VPLs that outlive their frame save, and what they cost: time, error of a still light, flicker of a moving one.

    python -m deferred_ir.profiling.studies.incremental cornell atrium

A scene whose spotlight has no motion gets a slow one. Frames of both graphs take turns, so that a noisy machine
disturbs them alike; times are medians on the GPU.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import dataclass, replace
from itertools import pairwise
from statistics import median
from typing import Any

import numpy as np

from deferred_ir.base.arrays import Array, Bools
from deferred_ir.base.progress import track
from deferred_ir.engine.record import Record
from deferred_ir.engine.renderer import Renderer
from deferred_ir.loading.load import load
from deferred_ir.profiling.measure import arguments, markdown
from deferred_ir.scene.geometry import Geometry, Model
from deferred_ir.scene.motion import FRAMES_PER_SECOND, LissajousMotion, ModelMotion
from deferred_ir.scene.scene import Material, Scene
from deferred_ir.truth.metrics import relmse
from deferred_ir.truth.reference import reference

VPLS = 256
MOST = 8
WARM = VPLS // MOST
"""Frames until all VPLs are there."""
MOVING = 12
"""Frames that are measured after them."""
SEEDS = 3
PATHS = 256
FRESH = 16
"""Frames that are averaged for the reference of a moving light: without VPLs' noise, but with their clamp and maps."""
TIMES = "scene", "redone, ms", "kept, ms", "times faster", "frame, ms", "frame kept, ms", "maps", "most maps"
ERRORS = "scene", "fresh Sobol set", "kept", "ratio", "flicker, random", "flicker, Sobol", "flicker, kept", "ratio"

BEHIND = "scene", "fresh Sobol set", "kept, a budget of all maps", "kept, a budget of 8"
BALL = 0.06
"""Radius of a ball that moves, in diagonals."""


@dataclass(frozen=True)
class Sizes:
    """Of the images that are timed, and of those that are compared."""

    timed: tuple[int, int] = (512, 512)
    compared: tuple[int, int] = (256, 256)


def moving(scene: Scene) -> Scene:
    """The scene, with a light that goes a tenth of its diagonal to and fro in 8 seconds, unless it has a motion."""
    light = scene.spotlight
    if light.motion:
        return scene
    x, y, z = (share * scene.geometry.diagonal for share in (0.05, 0.01, 0.05))
    start = light.position[0] - x, light.position[1] - y, light.position[2]  # at time 0 it is where it was
    return replace(scene, spotlight=replace(light, position=start, motion=LissajousMotion((x, y, z), (0.8, 0.5))))


def still(scene: Scene) -> Scene:
    """The scene, its light where it is at time 0."""
    return replace(scene, spotlight=replace(scene.spotlight.at(0), motion=None))


def times(scene: Scene, size: tuple[int, int]) -> dict[str, Any]:
    """Milliseconds of VPLs and maps and of whole frames, both ways, and the maps that were drawn."""
    with ExitStack() as stack:
        kept, redone = (stack.enter_context(Renderer(size, graph)) for graph in ("incremental", "interleaved"))
        plans = {one: one.plan(scene, VPLS) for one in (kept, redone)}
        records = {one: Record() for one in plans}
        redone.draw(scene, plans[redone])
        for frame in track(range(WARM + MOVING), f"{scene.name}, times"):
            measured = frame >= WARM
            for one, plan in plans.items():
                if measured or one is kept:
                    one.draw(scene, plan, time=frame / FRAMES_PER_SECOND, record=records[one] if measured else None)
        for one, record in records.items():
            one.finish(record)

        def ms(one: Renderer) -> float:
            return median(lap["vpl"][0] + lap["shadow_maps"][0] for lap in records[one].laps)

        maps = [counters["maps_drawn"] for counters in records[kept].counters]
        return {
            "redone": ms(redone),
            "kept": ms(kept),
            "frame": median(records[redone].frame_ms),
            "frame_kept": median(records[kept].frame_ms),
            "maps": median(maps),
            "most": max(maps),
        }


def errors(scene: Scene, size: tuple[int, int]) -> dict[str, float]:
    """relMSE of a still light against paths: a fresh set, and what has gathered after as many frames as it takes."""
    scene = still(scene)
    truth = reference(scene, size, spp=PATHS).radiance
    with Renderer(size, "incremental") as kept, Renderer(size, "interleaved") as fresh:
        plan, found = kept.plan(scene, VPLS), dict[str, list[float]](kept=[], sobol=[])
        for seed in track(range(SEEDS), f"{scene.name}, errors"):
            for _ in range(WARM):
                kept.draw(scene, plan, seed=seed)
            image = kept.read(plan).radiance
            hit = _hit(kept)
            found["kept"].append(relmse(image, truth, hit)[0])
            found["sobol"].append(relmse(fresh.render(scene, vpls=VPLS, seed=seed).radiance, truth, hit)[0])
    return {name: median(values) for name, values in found.items()}


def flicker(scene: Scene, size: tuple[int, int]) -> dict[str, float]:
    """Mean change of a pixel's error from frame to frame, over the mean radiance."""
    with ExitStack() as stack:
        kept, sobol, random = (
            stack.enter_context(Renderer(size, graph, set=settings))
            for graph, settings in (
                ("incremental", {}),
                ("interleaved", {}),
                ("interleaved", {"vpl.pattern": "random"}),
            )
        )
        plan, series = kept.plan(scene, VPLS), dict[str, list[Array]](kept=[], sobol=[], random=[])
        bright = []
        for frame in track(range(WARM + MOVING), f"{scene.name}, flicker"):
            time = frame / FRAMES_PER_SECOND
            kept.draw(scene, plan, time=time)
            if frame >= WARM:
                true = sobol.render(scene, vpls=VPLS, seed=1000, time=time, accumulate=FRESH).radiance
                images = {
                    "kept": kept.read(plan).radiance,
                    "sobol": sobol.render(scene, vpls=VPLS, time=time).radiance,
                    "random": random.render(scene, vpls=VPLS, seed=frame, time=time).radiance,
                }
                for name, image in images.items():
                    series[name].append(image - true)
                bright.append(float(true.mean()))
    return {
        name: float(np.mean([np.abs(b - a).mean() for a, b in pairwise(off)]) / np.mean(bright))
        for name, off in series.items()
    }


def crossed(scene: Scene) -> Scene:
    """The scene, its light and camera still, with a ball that takes 4 seconds through the middle half of its width."""
    import trimesh

    scene, geometry = still(scene), scene.geometry
    ball, count = trimesh.creation.icosphere(3, radius=BALL * geometry.diagonal), len(geometry.positions)
    new = len(ball.vertices)
    low, high = geometry.bounds
    across, middle = np.array([(high - low)[0] / 4, 0, 0]), (low + high) / 2
    ends = tuple((x, y, z) for x, y, z in (middle - across, middle + across))
    model = Model("ball", count, new, ModelMotion((0.0, 4.0), ends, ((0.0, 0.0, 0.0, 1.0),) * 2))

    def padded(values: Array | None, filler: float) -> Array | None:
        if values is None:
            return None
        return np.concatenate([values, np.full((new, values.shape[1]), filler, values.dtype)])

    geometry = Geometry(
        positions=np.concatenate([geometry.positions, ball.vertices]),
        # Faces without a texture come first.
        faces=np.concatenate([ball.faces + count, geometry.faces]).astype(np.int32),
        face_materials=np.append(np.full(len(ball.faces), len(scene.materials)), geometry.face_materials).astype("i4"),
        normals=padded(geometry.normals, 0),
        uvs=padded(geometry.uvs, 0),
        colors=padded(geometry.colors, 1),
        moving=(model,),
    )
    materials = (*scene.materials, Material("ball", (0.7, 0.7, 0.7)))
    return replace(scene, geometry=geometry, materials=materials, models=(*scene.models, model))


def behind(scene: Scene, size: tuple[int, int]) -> dict[str, float]:
    """relMSE of frames while a model moves, without what the interleaved set of all VPLs' mean gets wrong as well.

    Once the set is full: kept within the budget, kept with a budget for all maps, and a fresh Sobol set.
    """
    with ExitStack() as stack:
        kept, whole, fresh = (
            stack.enter_context(Renderer(size, graph, set=settings))
            for graph, settings in (("incremental", {}), ("incremental", {"vpl.most": VPLS}), ("interleaved", {}))
        )
        plans = {one: one.plan(scene, VPLS) for one in (kept, whole)}
        found = dict[str, list[float]](kept=[], whole=[], sobol=[])
        for frame in track(range(2 * WARM + MOVING), f"{scene.name}, behind"):
            time = frame / FRAMES_PER_SECOND
            kept.draw(scene, plans[kept], time=time)
            if frame < 2 * WARM:
                continue
            whole.draw(scene, plans[whole], time=time)
            if frame % SEEDS == 0:
                true = fresh.render(scene, vpls=VPLS, seed=1000, time=time, accumulate=FRESH).radiance
                images = {"sobol": fresh.render(scene, vpls=VPLS, time=time).radiance}
                images |= {name: one.read(plans[one]).radiance for name, one in (("kept", kept), ("whole", whole))}
                for name, image in images.items():
                    found[name].append(relmse(image, true, _hit(kept))[0])
    return {name: float(np.mean(values)) for name, values in found.items()}


def _hit(renderer: Renderer) -> Bools:
    """Which pixels show a surface, bool (H, W)."""
    with renderer.gpu.ctx:
        hit: Bools = renderer.executor.resource(("gbuffer", "depth")).read()[::-1, :, 0] > 0
    return hit


def row_of_times(scene: Scene, found: Mapping[str, Any]) -> list[str]:
    """Cells of TIMES."""
    cells = [scene.name, f"{found['redone']:.1f}", f"{found['kept']:.1f}", f"{found['redone'] / found['kept']:.1f}"]
    return [
        *cells,
        f"{found['frame']:.0f}",
        f"{found['frame_kept']:.0f}",
        f"{found['maps']:.0f}",
        f"{found['most']:.0f}",
    ]


def row_of_errors(scene: Scene, error: Mapping[str, float], change: Mapping[str, float]) -> list[str]:
    """Cells of ERRORS."""
    cells = [scene.name, f"{error['sobol']:.4f}", f"{error['kept']:.4f}", f"{error['kept'] / error['sobol']:.2f}"]
    cells += [f"{change[name]:.4f}" for name in ("random", "sobol", "kept")]
    return [*cells, f"{change['kept'] / change['random']:.2f}"]


def main() -> None:
    """Measure, print."""
    chosen, sizes = arguments(__doc__, output=False).parse_args(), Sizes()
    scenes = [moving(load(name)) for name in chosen.scenes]
    print(markdown(TIMES, [row_of_times(scene, times(scene, sizes.timed)) for scene in scenes]), flush=True)
    rows = [(scene.name, behind(crossed(scene), sizes.compared)) for scene in scenes]
    cells = [[name, *(f"{error[kind]:.4f}" for kind in ("sobol", "whole", "kept"))] for name, error in rows]
    print(f"\n{markdown(BEHIND, cells)}", flush=True)
    found = [(scene, errors(scene, sizes.compared), flicker(scene, sizes.compared)) for scene in scenes]
    print(f"\n{markdown(ERRORS, [row_of_errors(*each) for each in found])}")


if __name__ == "__main__":
    main()
