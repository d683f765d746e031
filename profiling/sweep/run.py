"""Running a sweep: reference, mask, points and peers, each saved as soon as it is there, so that it can be resumed."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from deferred_ir.base.progress import progress_bar
from deferred_ir.engine.renderer import Renderer
from deferred_ir.profiling.measure import name_device
from deferred_ir.profiling.peers import ladder
from deferred_ir.profiling.peers.points import Peers
from deferred_ir.profiling.sweep import costs, edge_mask, measure_point, points, reference
from deferred_ir.profiling.sweep.edge_mask import Mask
from deferred_ir.profiling.sweep.measure_point import Setup
from deferred_ir.profiling.sweep.points import Point
from deferred_ir.profiling.sweep.reference import Truth
from deferred_ir.profiling.sweep.sweep import Sweep, Task
from deferred_ir.report.origin import Origin


@dataclass(frozen=True, eq=False)
class Results:
    """The points of a sweep in order, at least one, those of its peers, and the mask of the masked errors."""

    points: Sequence[Point]
    peers: Peers
    mask: Mask | None


def run(sweep: Sweep, folder: Path, given: Path | None, origin: Origin) -> Results:
    """Measure what is not in `folder` yet, after saying how long that takes. Returns all points of the sweep's shard.

    given: a reference image to use. origin: this run, saved with what it measures.
    """
    truth = reference.read(given, sweep.scene, sweep.size, sweep.time) if given else None
    device = name_device(sweep.device)
    points.make_folder(folder)
    # All shards name the same graphs, so they agree on a reference.
    hashes = [sweep.graph_hash(graph, max(sweep.vpls)) for graph in sweep.graphs]
    deciding = {"graphs": hashes, "device": device, "most_spp": sweep.most_spp}
    truth = truth or reference.load(folder, sweep.moment, sweep.size, deciding)
    done, ahead = _find_points(sweep, folder, truth, device)
    if done:
        print(f"{len(done)} of {len(done) + len(ahead)} points are there already", file=sys.stderr)
    seconds: dict[Task, float] = {}
    if ahead:
        graphs = dict.fromkeys(graph for graph, _, _ in ahead) if truth else sweep.graphs
        trials = costs.try_graphs(sweep, list(graphs))
        seconds = costs.estimate_points(trials, ahead)
        print(_announce(sweep, folder, seconds, traces=truth is None), file=sys.stderr)
    if truth is None:
        with progress_bar() as bar:
            truth = reference.load_or_trace(
                folder,
                sweep.moment,
                sweep.size,
                deciding,
                most_spp=sweep.most_spp,
                images=lambda: [trial.image for trial in trials.values()],
                bar=bar,
            )
        done, ahead = _find_points(sweep, folder, truth, device)
    with progress_bar("edges") as bar:
        mask = edge_mask.load_or_find(folder, sweep.moment, sweep.size, bar.show)
    done += _measure(Setup(sweep, folder, origin, truth, mask), {task: seconds[task] for task in ahead})
    peers = Peers()
    if sweep.peers and sweep.shard[0] == 1:
        course = ladder.Course(sweep.moment, sweep.size, sweep.seeds, truth, mask, origin)
        peers = ladder.run(course, folder, sweep.peers)
    return Results(points.sort(done), peers, mask)


def _announce(sweep: Sweep, folder: Path, points_ahead: Mapping[Task, float], *, traces: bool) -> str:
    """Say how long the sweep takes and what takes it. points_ahead: seconds. traces: whether a reference is traced."""
    scene, size = sweep.moment, sweep.size
    parts = {f"{len(points_ahead)} points": (sum(points_ahead.values()),) * 2}
    if traces:
        path = costs.estimate_paths(scene, size, reference.find_bounces(scene))
        spp = reference.FIRST_SPP, sweep.most_spp
        parts[f"a reference of {spp[0]} to {spp[1]} paths a pixel"] = path * spp[0], path * spp[1]
    if edge_mask.read(folder, scene.hash, size) is None:
        parts["edges"] = (costs.estimate_edges(scene, size),) * 2
    whole = costs.format_range(*(sum(bounds) for bounds in zip(*parts.values(), strict=True)))
    text = f"this takes about {whole}: " + ", ".join(
        f"{name} {costs.format_range(*bounds)}" for name, bounds in parts.items()
    )
    if sweep.peers and sweep.shard[0] == 1:
        most = costs.format_time(ladder.BUDGET / 1e3)
        text += f"; then for each peer that is installed at most about {most}"
    return text


def _find_points(sweep: Sweep, folder: Path, truth: Truth | None, device: str) -> tuple[list[Point], list[Task]]:
    """Return the points in `folder` that were compared with this reference on this device, and the other tasks."""
    done, ahead = list[Point](), list[Task]()
    if truth is None:
        return done, sweep.tasks()
    truth_hash = truth.hash
    for task in sweep.tasks():
        point = points.read(folder, sweep.key(*task).name)
        if point and point.reference == truth_hash and point.device == device:
            done.append(points.rename(point, task[0]))
        else:
            ahead.append(task)
    return done, ahead


def _measure(setup: Setup, tasks: Mapping[Task, float]) -> Iterator[Point]:
    """Measure and save points, with a progress bar. tasks: the seconds that each is likely to take."""
    sweep = setup.sweep
    with progress_bar(total=sum(tasks.values())) as bar:
        for graph in dict.fromkeys(graph for graph, _, _ in tasks):
            with Renderer(sweep.size, graph, sweep.device, set=sweep.settings) as renderer:
                for task, seconds in tasks.items():
                    name, vpls, seed = task
                    if name != graph:
                        continue
                    bar.label(f"{graph}, {vpls} VPLs, seed {seed}")
                    yield measure_point.measure(setup, renderer, graph, sweep.key(graph, vpls, seed))
                    bar.advance(seconds)
