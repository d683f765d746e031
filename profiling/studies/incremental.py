"""Measure what VPLs retained between frames save and cost: time, error of a still light, flicker of a moving one.

    python -m deferred_ir.profiling.studies.incremental cornell atrium

A spotlight without a motion is given a slow one. Frames of both graphs take turns, so that a noisy machine disturbs
them alike; times are medians.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from itertools import pairwise
from statistics import median
from typing import Any

import numpy as np

from deferred_ir.base.arrays import Array, Bools
from deferred_ir.base.progress import track
from deferred_ir.engine.measurement import Measurement
from deferred_ir.engine.renderer import Renderer
from deferred_ir.loading.load import load
from deferred_ir.profiling.figures import markdown
from deferred_ir.profiling.measure import take_turns
from deferred_ir.profiling.moving_scenes import add_moving_ball, hold_light, move_light
from deferred_ir.profiling.study import command_line, run
from deferred_ir.scene.motion import FRAMES_PER_SECOND
from deferred_ir.scene.scene import Scene
from deferred_ir.truth.metrics import relmse
from deferred_ir.truth.reference import trace_reference

VPLS = 256
MOST = 8
"""The budget of the graph `incremental`: shadow maps that are drawn anew in a frame."""
WARM = VPLS // MOST
"""Frames until the set is full."""
MOVING = 12
"""Frames that are measured after those."""
SEEDS = 3
PATHS = 256
FRESH = 16
"""Frames averaged for the reference of a moving light: without the VPLs' noise, but with their clamp and maps."""
TIMES = "scene", "fresh set, ms", "retained, all pixels, ms", "retained, ms", "times faster", "maps", "most maps"
ERRORS = (
    *("scene", "error, fresh Sobol set", "retained, all pixels", "retained", "ratio"),
    *("flicker, random", "Sobol", "retained, all pixels", "retained", "ratio"),
)
ALL_PIXELS = {"sample_pixels.scale": 1, "interleave.n": 4, "neighbours.fewest": 0.5}
"""Settings with which VPLs light all pixels, as in `interleaved`."""
MAPS = {"direct_rays.visibility": "maps"}
"""Settings with which direct light is the same in all graphs: only that of VPLs is compared."""
LAG = "scene", "fresh Sobol set", "retained, a budget of all maps", "retained, a budget of 8"


@dataclass(frozen=True)
class Sizes:
    """Sizes (width, height) of the images that are timed, and of those that are compared."""

    timed: tuple[int, int] = (512, 512)
    compared: tuple[int, int] = (256, 256)


def times(scene: Scene, size: tuple[int, int]) -> dict[str, Any]:
    """Return the milliseconds of frames: fresh, retained, and retained with all pixels; and the number of maps."""
    graphs = {"fresh": ("interleaved", {}), "whole": ("incremental", ALL_PIXELS), "retained": ("incremental", {})}
    with ExitStack() as stack:
        drawn = {
            name: stack.enter_context(Renderer(size, graph, set=given, reuse=True))
            for name, (graph, given) in graphs.items()
        }
        plans = {name: one.plan(scene, VPLS) for name, one in drawn.items()}
        measured = {name: Measurement() for name in drawn}
        for frame in range(WARM):
            for name in ("whole", "retained") if frame < WARM - 1 else graphs:
                drawn[name].draw(scene, plans[name], time=frame / FRAMES_PER_SECOND)
        for turn, name in take_turns(list(drawn), MOVING, f"{scene.name}, times"):
            time = (WARM + turn) / FRAMES_PER_SECOND
            drawn[name].draw(scene, plans[name], time=time, measurement=measured[name])
        for name, measurement in measured.items():
            drawn[name].finish(measurement)
    maps = [counters["maps_drawn"] for counters in measured["retained"].counters]
    ms = {name: median(measurement.frame_ms) for name, measurement in measured.items()}
    return {**ms, "maps": median(maps), "most": max(maps)}


def errors(scene: Scene, size: tuple[int, int]) -> dict[str, float]:
    """Return the relMSE of a still light against paths: of a full retained set and of a fresh one."""
    scene = hold_light(scene)
    truth = trace_reference(scene, size, spp=PATHS).radiance
    values = dict[str, list[float]](retained=[], whole=[], sobol=[])
    with (
        Renderer(size, "incremental") as retained,
        Renderer(size, "incremental", set=ALL_PIXELS) as whole,
        Renderer(size, "interleaved") as fresh,
    ):
        plans = {one: one.plan(scene, VPLS) for one in (retained, whole)}
        for seed in track(range(SEEDS), f"{scene.name}, errors"):
            for _ in range(WARM):
                for one, plan in plans.items():
                    one.draw(scene, plan, seed=seed)
            hit = _hit(retained)
            for name, one in (("retained", retained), ("whole", whole)):
                values[name].append(relmse(one.read(plans[one]).radiance, truth, hit)[0])
            values["sobol"].append(relmse(fresh.render(scene, vpls=VPLS, seed=seed).radiance, truth, hit)[0])
    return {name: median(each) for name, each in values.items()}


def flicker(scene: Scene, size: tuple[int, int]) -> dict[str, float]:
    """Return the mean change of a pixel's error from frame to frame, over the mean radiance."""
    errors, brightness = dict[str, list[Array]](retained=[], whole=[], sobol=[], random=[]), []
    with (
        Renderer(size, "incremental", set=MAPS) as retained,
        Renderer(size, "incremental", set=MAPS | ALL_PIXELS) as whole,
        Renderer(size, "interleaved") as sobol,
        Renderer(size, "interleaved", set={"vpl.pattern": "random"}) as random,
    ):
        plans = {one: one.plan(scene, VPLS) for one in (retained, whole)}
        for frame in track(range(WARM + MOVING), f"{scene.name}, flicker"):
            time = frame / FRAMES_PER_SECOND
            for one, plan in plans.items():
                one.draw(scene, plan, time=time)
            if frame < WARM:
                continue
            truth = sobol.render(scene, vpls=VPLS, seed=1000, time=time, accumulate=FRESH).radiance
            images = {
                "retained": retained.read(plans[retained]).radiance,
                "whole": whole.read(plans[whole]).radiance,
                "sobol": sobol.render(scene, vpls=VPLS, time=time).radiance,
                "random": random.render(scene, vpls=VPLS, seed=frame, time=time).radiance,
            }
            for name, image in images.items():
                errors[name].append(image - truth)
            brightness.append(float(truth.mean()))
    return {
        name: float(np.mean([np.abs(b - a).mean() for a, b in pairwise(each)]) / np.mean(brightness))
        for name, each in errors.items()
    }


def lag(scene: Scene, size: tuple[int, int]) -> dict[str, float]:
    """Return the relMSE of frames while a model moves, against the mean of fresh sets, which share clamp and maps.

    Once the set is full: retained within the budget, retained with a budget of all maps (`whole`), and a fresh Sobol
    set.
    """
    values = dict[str, list[float]](retained=[], whole=[], sobol=[])
    with (
        Renderer(size, "incremental", set=MAPS) as retained,
        Renderer(size, "incremental", set=MAPS | {"vpl.most": VPLS}) as whole,
        Renderer(size, "interleaved") as fresh,
    ):
        plans = {one: one.plan(scene, VPLS) for one in (retained, whole)}
        for frame in track(range(2 * WARM + MOVING), f"{scene.name}, lag"):
            time = frame / FRAMES_PER_SECOND
            retained.draw(scene, plans[retained], time=time)
            if frame < 2 * WARM:
                continue
            whole.draw(scene, plans[whole], time=time)
            if frame % SEEDS == 0:
                truth = fresh.render(scene, vpls=VPLS, seed=1000, time=time, accumulate=FRESH).radiance
                images = {
                    "retained": retained.read(plans[retained]).radiance,
                    "whole": whole.read(plans[whole]).radiance,
                    "sobol": fresh.render(scene, vpls=VPLS, time=time).radiance,
                }
                for name, image in images.items():
                    values[name].append(relmse(image, truth, _hit(retained))[0])
    return {name: float(np.mean(each)) for name, each in values.items()}


def _hit(renderer: Renderer) -> Bools:
    """Return which pixels show a surface, bool (H, W)."""
    with renderer.gpu.ctx:
        hit: Bools = renderer.executor.resource(("gbuffer", "depth")).read()[::-1, :, 0] > 0
    return hit


def row_of_times(scene: Scene, ms: Mapping[str, Any]) -> list[str]:
    """Return the cells of TIMES."""
    return [
        scene.name,
        *(f"{ms[name]:.0f}" for name in ("fresh", "whole", "retained")),
        f"{ms['fresh'] / ms['retained']:.1f}",
        *(f"{ms[name]:.0f}" for name in ("maps", "most")),
    ]


def row_of_errors(scene: Scene, error: Mapping[str, float], change: Mapping[str, float]) -> list[str]:
    """Return the cells of ERRORS."""
    return [
        *(scene.name, f"{error['sobol']:.4f}", f"{error['whole']:.4f}", f"{error['retained']:.4f}"),
        f"{error['retained'] / error['sobol']:.2f}",
        *(f"{change[name]:.4f}" for name in ("random", "sobol", "whole", "retained")),
        f"{change['retained'] / change['random']:.2f}",
    ]


def report(chosen: argparse.Namespace) -> None:
    """Print the three tables with a row for each scene."""
    sizes = Sizes()
    scenes = [move_light(load(name)) for name in chosen.scenes]
    print(markdown(TIMES, [row_of_times(scene, times(scene, sizes.timed)) for scene in scenes]), flush=True)
    rows = [(scene.name, lag(add_moving_ball(scene), sizes.compared)) for scene in scenes]
    cells = [[name, *(f"{error[kind]:.4f}" for kind in ("sobol", "whole", "retained"))] for name, error in rows]
    print(f"\n{markdown(LAG, cells)}", flush=True)
    results = [(scene, errors(scene, sizes.compared), flicker(scene, sizes.compared)) for scene in scenes]
    print(f"\n{markdown(ERRORS, [row_of_errors(*each) for each in results])}")


def main(words: Sequence[str] | None = None) -> None:
    """Run the study."""
    run(command_line(__doc__), report, words)


if __name__ == "__main__":
    main()
