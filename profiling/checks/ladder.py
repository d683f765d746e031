"""Measure the ladder of `render --within`: error and time of every rung, or the time predicted against that achieved.

    python -m deferred_ir.profiling.checks.ladder cornell colors atrium --size 256x256 --spp 1024 --seeds 3
    python -m deferred_ir.profiling.checks.ladder cornell colors atrium --size 256x256 --tables times

Errors are trimmed relMSE, the reference's noise taken off, means over seeds; times are medians. The rungs are in
deferred_ir/tuning/ladder.py.
"""

from __future__ import annotations

import argparse
import time as clock
from collections.abc import Sequence
from statistics import mean, median
from typing import Any

from deferred_ir.base.progress import progress_bar, track
from deferred_ir.engine.renderer import Renderer
from deferred_ir.engine.within import choose
from deferred_ir.loading.load import load
from deferred_ir.profiling.figures import markdown
from deferred_ir.profiling.study import command_line, run
from deferred_ir.scene.scene import Scene
from deferred_ir.truth.metrics import relmse
from deferred_ir.truth.reference import trace_reference
from deferred_ir.tuning.ladder import GRAPH, RUNGS

SECONDS = (0.05, 0.1, 0.2, 0.5, 1.0, 3.0)
TOP_FRAMES = (2, 4, 8)
"""Numbers of frames that are averaged with the last rung."""


def measure_rungs(renderer: Renderer, scene: Scene, spp: int, seeds: int) -> list[list[str]]:
    """Return a row for each rung, and for means of several frames of the last."""
    with progress_bar(f"reference of {scene.name}") as bar:
        truth = trace_reference(scene, renderer.size, spp=spp, progress=bar.show)
    rows = []
    steps = [(set, 1) for set in RUNGS] + [(RUNGS[-1], frames) for frames in TOP_FRAMES]
    for set, frames in track(steps, scene.name):
        renderer.configure(graph=GRAPH, set=set)
        renderer.render(scene)  # compiles and allocates
        errors, times = [], []
        for seed in range(seeds):
            start = clock.perf_counter()
            image = renderer.render(scene, seed=seed, accumulate=frames)
            times.append((clock.perf_counter() - start) * 1e3)
            errors.append(relmse(image.radiance, truth.radiance, truth.hit)[0] - float(truth.meta["noise"]))
        settings = ", ".join(f"{key.partition('.')[2]} {value}" for key, value in set.items()) or "the graph's own"
        name = settings if frames == 1 else f"{frames} frames of it"
        rows.append([scene.name, str(RUNGS.index(set)), name, f"{mean(errors):.4f}", f"{median(times):.0f}"])
    return rows


def measure_times(renderer: Renderer, scene: Scene, turns: int) -> list[list[str]]:
    """Return a row for each of SECONDS: what was chosen, what it was predicted to take, and what it takes."""
    rows = []
    for seconds in track(SECONDS, scene.name):
        renderer.configure(graph=GRAPH, set={})
        choice = choose(renderer, scene, seconds, lambda: renderer.plan(scene, outputs=["radiance", "display"]))
        times = []
        for seed in range(turns):
            start = clock.perf_counter()
            renderer.render(scene, seed=seed, accumulate=choice.frames)
            times.append((clock.perf_counter() - start) * 1e3)
        achieved = median(times)
        rung = next((str(number) for number, set in enumerate(RUNGS) if set == choice.set), "?")
        cells = [f"{1e3 * seconds:.0f}", rung, f"{choice.frames}", f"{choice.ms:.0f}", f"{achieved:.0f}"]
        rows.append([scene.name, *cells, f"{achieved / choice.ms:.2f}"])
    return rows


def report(chosen: argparse.Namespace) -> None:
    """Print the tables that are asked for, in Markdown."""
    scenes = [load(name) for name in chosen.scenes]
    with Renderer(chosen.size, GRAPH, chosen.device) as renderer:
        if "rungs" in chosen.tables:
            rows = [row for scene in scenes for row in measure_rungs(renderer, scene, chosen.spp, chosen.seeds)]
            print(markdown(["scene", "rung", "settings", "relMSE", "ms"], rows))
        if "times" in chosen.tables:
            rows = [row for scene in scenes for row in measure_times(renderer, scene, chosen.turns)]
            print(markdown(["scene", "asked ms", "rung", "frames", "predicted ms", "ms", "ms / predicted"], rows))


def main(words: Sequence[str] | None = None) -> None:
    """Run the measurement."""
    options: dict[str, Any] = {
        "size": (256, 256),
        "spp": 1024,
        "seeds": 3,
        "turns": 5,
        "tables": ["rungs"],
        "device": "auto",
    }
    run(command_line(__doc__, **options), report, words)


if __name__ == "__main__":
    main()
