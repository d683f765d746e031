"""What VPLs that outlive their frame save, and what they cost: time, error of a still light, flicker of a moving one.

    python -m deferred_ir.profiling.incremental cornell atrium

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
from tqdm import tqdm

from deferred_ir.loading import load
from deferred_ir.metrics import relmse
from deferred_ir.motion import FRAMES_PER_SECOND, LissajousMotion
from deferred_ir.profiling.output import arguments, markdown
from deferred_ir.reference import reference
from deferred_ir.renderer import Renderer
from deferred_ir.scene import Scene
from deferred_ir.timing import Record
from deferred_ir.typing import Array, Bools

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
        for frame in tqdm(range(WARM + MOVING), desc=f"{scene.name}, times", disable=None):
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
        for seed in tqdm(range(SEEDS), desc=f"{scene.name}, errors", disable=None):
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
        for frame in tqdm(range(WARM + MOVING), desc=f"{scene.name}, flicker", disable=None):
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
    found = [(scene, errors(scene, sizes.compared), flicker(scene, sizes.compared)) for scene in scenes]
    print(f"\n{markdown(ERRORS, [row_of_errors(*each) for each in found])}")


if __name__ == "__main__":
    main()
