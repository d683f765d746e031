"""Running a sweep: reference, mask, points and peers, each saved as soon as it is there, so that it can be resumed."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from deferred_ir.base.arrays import Array
from deferred_ir.base.progress import progress_bar
from deferred_ir.engine.renderer import Renderer
from deferred_ir.profiling.measure import name_device
from deferred_ir.profiling.peers import ladder
from deferred_ir.profiling.peers.points import Peers
from deferred_ir.profiling.sweep import edge_mask, measure_point, points, reference
from deferred_ir.profiling.sweep.edge_mask import Mask
from deferred_ir.profiling.sweep.measure_point import Setup
from deferred_ir.profiling.sweep.points import Point
from deferred_ir.profiling.sweep.reference import Truth
from deferred_ir.profiling.sweep.sweep import Sweep, Task
from deferred_ir.report.origin import Origin

OVERHEAD = 16
"""Cost of a frame besides its VPLs, in VPLs: weighs the points for the time left on the progress bar."""


@dataclass(frozen=True, eq=False)
class Results:
    """The points of a sweep in order, at least one, those of its peers, and the mask of the masked errors."""

    points: Sequence[Point]
    peers: Peers
    mask: Mask | None


def run(sweep: Sweep, folder: Path, given: Path | None, origin: Origin) -> Results:
    """Measure what is not in `folder` yet. Returns all points of the sweep's shard.

    given: a reference image to use. origin: this run, saved with what it measures.
    """
    truth = reference.read(given, sweep.scene, sweep.size, sweep.time) if given else None
    device = name_device(sweep.device)
    points.make_folder(folder)
    if truth is None:
        truth = _load_or_trace(sweep, folder, device)
    with progress_bar("edges") as bar:
        mask = edge_mask.load_or_find(folder, sweep.moment, sweep.size, bar.show)
    done, ahead = _find_points(sweep, folder, truth, device)
    if done:
        print(f"{len(done)} of {len(done) + len(ahead)} points are there already", file=sys.stderr)
    done += _measure(Setup(sweep, folder, origin, truth, mask), ahead)
    peers = Peers()
    if sweep.peers and sweep.shard[0] == 1:
        course = ladder.Course(sweep.moment, sweep.size, sweep.seeds, truth, mask, origin)
        peers = ladder.run(course, folder, sweep.peers)
    return Results(points.sort(done), peers, mask)


def _load_or_trace(sweep: Sweep, folder: Path, device: str) -> Truth:
    """Return a reference that is good enough for the best images of the sweep."""
    # All shards name the same graphs, so they agree on a reference.
    deciding = {"graphs": [sweep.graph_hash(graph, max(sweep.vpls)) for graph in sweep.graphs], "device": device}
    with progress_bar() as bar:

        def images() -> list[Array]:
            bar.print("rendering each graph once, to see how many paths the reference needs", sys.stderr)
            return _probe(sweep)

        return reference.load_or_trace(folder, sweep.moment, sweep.size, deciding, images=images, bar=bar)


def _probe(sweep: Sweep) -> list[Array]:
    """Render an image of each graph with the most VPLs, whose errors are likely to be the smallest."""
    images = []
    for graph in sweep.graphs:
        with Renderer(sweep.size, graph, sweep.device, set=sweep.settings) as renderer:
            plan = renderer.plan(sweep.scene, max(sweep.vpls), ["radiance"])
            for time in sweep.frame_times(plan):
                renderer.draw(sweep.scene, plan, time=time)
            images.append(renderer.read(plan).radiance)
    return images


def _find_points(sweep: Sweep, folder: Path, truth: Truth, device: str) -> tuple[list[Point], list[Task]]:
    """Return the points in `folder` that were compared with this reference on this device, and the other tasks."""
    done, ahead = list[Point](), list[Task]()
    truth_hash = truth.hash
    for task in sweep.tasks():
        point = points.read(folder, sweep.key(*task).name)
        if point and point.reference == truth_hash and point.device == device:
            done.append(points.rename(point, task[0]))
        else:
            ahead.append(task)
    return done, ahead


def _measure(setup: Setup, tasks: Sequence[Task]) -> Iterator[Point]:
    """Measure and save points, with a progress bar."""
    sweep = setup.sweep
    with progress_bar(total=sum(vpls + OVERHEAD for _, vpls, _ in tasks)) as bar:
        for graph in dict.fromkeys(graph for graph, _, _ in tasks):
            with Renderer(sweep.size, graph, sweep.device, set=sweep.settings) as renderer:
                for _, vpls, seed in (task for task in tasks if task[0] == graph):
                    bar.label(f"{graph}, {vpls} VPLs, seed {seed}")
                    yield measure_point.measure(setup, renderer, graph, sweep.key(graph, vpls, seed))
                    bar.advance(vpls + OVERHEAD)
