"""Measure what leaving out saves: frame time, start-up time and memory with it and without, in turns.

python -m deferred_ir.profiling.studies.left_out cornell atrium colors
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

from deferred_ir.engine.renderer import Renderer
from deferred_ir.loading.load import load
from deferred_ir.profiling.figures import markdown
from deferred_ir.profiling.limits.host_costs import seconds
from deferred_ir.profiling.measure import take_turns, time_frames
from deferred_ir.profiling.study import command_line, run

GRAPHS = ("deferred", "interleaved")
HEAD = ("scene", "graph", "frame [ms]", "with all", "start [s]", "with all", "memory [MiB]", "with all")
KEEP_ALL = (False, True)
"""The two variants: nothing needless is done, and everything is (`--keep-all`)."""
STARTS = 5
"""Most processes that are started of each variant."""


def frames(
    scene: str, graph: str, *, vpls: int, size: tuple[int, int], turns: int, device: str
) -> tuple[list[float], list[int]]:
    """Return the median frame time [ms] and the memory [bytes] of each variant.

    Raises RuntimeError if their images differ in a single bit.
    """
    loaded = load(scene)
    with ExitStack() as stack:
        renderers = {way: stack.enter_context(Renderer(size, graph, device, keep_all=way)) for way in KEEP_ALL}
        plans = {way: one.plan(loaded, vpls, ["radiance", "display"]) for way, one in renderers.items()}
        times = time_frames(loaded, renderers, plans, turns, label=f"{loaded.name}, {graph}")
        images = [one.read(plans[way]).radiance for way, one in renderers.items()]
        if not np.array_equal(*images):
            raise RuntimeError(f"{scene}, {graph}: leaving out has changed the image")
        return [median(times[way].frame_ms) for way in KEEP_ALL], [
            sum(one.memory().values()) for one in renderers.values()
        ]


def starts(scene: str, graph: str, *, vpls: int, size: tuple[int, int], turns: int, device: str) -> list[float]:
    """Return the shortest wall time [s] of a process that renders one image, for each variant."""
    times: dict[bool, list[float]] = {way: [] for way in KEEP_ALL}
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "deferred_ir", "render", scene, "-o", str(Path(folder, "image.png"))]
        command += ["--graph", graph, "--vpls", str(vpls), "--size", "x".join(map(str, size)), "--device", device]
        for _, way in take_turns(KEEP_ALL, turns, f"{scene}, {graph}, starts"):
            times[way].append(seconds([*command, "--keep-all"] if way else command))
    return [min(values) for values in times.values()]


def row(
    scene: str, graph: str, *, vpls: int = 64, size: tuple[int, int] = (512, 512), turns: int = 15, device: str = "auto"
) -> Sequence[str]:
    """Measure a scene with a graph. Returns the cells of HEAD."""
    options: dict[str, Any] = {"vpls": vpls, "size": size, "device": device}
    ms, memory = frames(scene, graph, turns=turns, **options)
    start = starts(scene, graph, turns=min(turns, STARTS), **options)
    cells = [f"{figure:.0f}" for figure in ms] + [f"{figure:.2f}" for figure in start]
    return [scene, graph, *cells, *(f"{figure / 2**20:.1f}" for figure in memory)]


def report(chosen: argparse.Namespace) -> None:
    """Print a row for each scene and graph."""
    options = {"vpls": chosen.vpls, "turns": chosen.turns, "device": chosen.device}
    print(markdown(HEAD, [row(scene, graph, **options) for scene in chosen.scenes for graph in GRAPHS]))


def main(words: Sequence[str] | None = None) -> None:
    """Run the study."""
    run(command_line(__doc__, vpls=64, turns=15, device="auto"), report, words)


if __name__ == "__main__":
    main()
