"""How long a sweep is going to take: from a few frames of each graph, and a few paths and edges of a small image."""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from deferred_ir.base.arrays import Array
from deferred_ir.base.progress import progress_bar
from deferred_ir.engine.renderer import Renderer
from deferred_ir.engine.setup import IMAGES
from deferred_ir.profiling.sweep import edge_mask
from deferred_ir.profiling.sweep.sweep import FRAMES, Sweep, Task
from deferred_ir.scene.scene import Scene
from deferred_ir.truth.metrics import compare
from deferred_ir.truth.reference import trace_reference

PATHS = 32
"""Paths a pixel whose time is measured, of an image of a quarter of the pixels."""
PART = 4
"""The edges of an image of 1 / PART of the width and height are found, to know how long all take."""
TINY = 4, 4
"""An image of this size takes only what does not depend on the size."""


@dataclass(frozen=True, eq=False)
class Trial:
    """A few frames of a graph. Times in seconds.

    image: radiance with the most VPLs of the sweep. start: beyond the time of a frame, what opening the graph and its
    first frame take. frame: time of a frame by number of VPLs, for the fewest and the most. frames: those of a point.
    """

    image: Array
    start: float
    frame: Mapping[int, float]
    frames: int

    def estimate_point(self, vpls: int) -> float:
        """Return how long the frames of a point take: the time of one is linear in the VPLs between those tried."""
        least, most = min(self.frame), max(self.frame)
        slope = (self.frame[most] - self.frame[least]) / max(most - least, 1)
        # About one frame more for the passes that are left out: they are run to measure what that saves.
        return (self.frames + 1) * max(self.frame[least] + slope * (vpls - least), 0.0)


def try_graphs(sweep: Sweep, graphs: Sequence[str]) -> dict[str, Trial]:
    """Draw a few frames with each graph, with a progress bar."""
    trials: dict[str, Trial] = {}
    with progress_bar("a few frames of each graph", len(graphs)) as bar:
        for graph in graphs:
            trials[graph] = _try_graph(sweep, graph)
            bar.advance()
    return trials


def _try_graph(sweep: Sweep, graph: str) -> Trial:
    start = clock.perf_counter()
    frame: dict[int, float] = {}
    with Renderer(sweep.size, graph, sweep.device, set=sweep.settings) as renderer:
        for vpls in sorted({min(sweep.vpls), max(sweep.vpls)}):
            outputs = [name for name in renderer.graph(vpls).outputs if name in IMAGES]
            plan = renderer.plan(sweep.scene, vpls, outputs)
            times = sweep.frame_times(plan)
            for time in times[FRAMES - 1 :]:  # state is complete before the last
                before = clock.perf_counter()
                renderer.draw(sweep.scene, plan, time=time)
                frame[vpls] = clock.perf_counter() - before
        image = renderer.read(plan).radiance
    return Trial(image, max(clock.perf_counter() - start - 2 * sum(frame.values()), 0.0), frame, len(times))


def estimate_points(trials: Mapping[str, Trial], tasks: Sequence[Task]) -> dict[Task, float]:
    """Return how long each point takes, seconds; the first of a graph opens it."""
    found: dict[Task, float] = {}
    comparing = _time_comparison(next(iter(trials.values())).image) if trials else 0.0
    for task in tasks:
        graph, vpls, _ = task
        opens = all(other != graph for other, *_ in found)
        found[task] = trials[graph].estimate_point(vpls) + comparing + opens * trials[graph].start
    return found


def _time_comparison(image: Array) -> float:
    """Return the seconds that comparing an image with a reference takes; 0 for a black one, which cannot be one."""
    start = clock.perf_counter()
    if image.any():
        compare(image, image)
    return clock.perf_counter() - start


def estimate_paths(scene: Scene, size: tuple[int, int], bounces: int) -> float:
    """Return the seconds that one path for each pixel of an image of `size` takes."""
    small = max(size[0] // 2, TINY[0]), max(size[1] // 2, TINY[1])
    seconds = _time_pixel(lambda pixels: trace_reference(scene, pixels, spp=PATHS, bounces=bounces), small)
    return seconds / PATHS * _area(size)


def estimate_edges(scene: Scene, size: tuple[int, int]) -> float:
    """Return the seconds that finding the edges of an image of `size` takes."""
    small = max(size[0] // PART, TINY[0]), max(size[1] // PART, TINY[1])
    return _time_pixel(lambda pixels: edge_mask.find(scene, pixels), small) * _area(size)


def _time_pixel(work: Callable[[tuple[int, int]], object], size: tuple[int, int]) -> float:
    """Return the seconds of `work` for each pixel of an image of `size`, without what takes as long for a TINY one."""
    seconds = []
    for pixels in (TINY, size):
        start = clock.perf_counter()
        work(pixels)
        seconds.append(clock.perf_counter() - start)
    return max(seconds[1] - seconds[0], 0.0) / _area(size)


def _area(size: tuple[int, int]) -> int:
    return size[0] * size[1]


def format_time(seconds: float) -> str:
    """Format about how long something takes: "40 s", "12 min", "3 h"."""
    if seconds < 100:
        return f"{max(seconds, 1):.0f} s"
    minutes = seconds / 60
    return f"{minutes:.0f} min" if minutes < 100 else f"{minutes / 60:.1f} h"


def format_range(least: float, most: float) -> str:
    """Format from how long to how long something takes."""
    low, high = format_time(least), format_time(most)
    if low == high:
        return low
    (number, unit), (_, other) = low.split(), high.split()
    return f"{number} to {high}" if unit == other else f"{low} to {high}"
