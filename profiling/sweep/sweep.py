"""Graphs x numbers of VPLs x seeds: time and error of each point, kept on disk as soon as it is measured."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from deferred_ir.base.arrays import Array
from deferred_ir.base.errors import GraphError, SettingError
from deferred_ir.base.progress import progress_bar
from deferred_ir.engine.measurement import Measurement
from deferred_ir.engine.renderer import IMAGES, Renderer
from deferred_ir.gl.context import Gpu
from deferred_ir.graph.file import graph_hash, load_graph
from deferred_ir.graph.graph import Plan
from deferred_ir.profiling.peers import ladder
from deferred_ir.profiling.peers.points import Peers
from deferred_ir.profiling.sweep import edge_mask, points
from deferred_ir.profiling.sweep import reference as sweep_reference
from deferred_ir.profiling.sweep.edge_mask import Mask
from deferred_ir.profiling.sweep.points import Key, Point
from deferred_ir.profiling.sweep.reference import Truth
from deferred_ir.report import left_out as savings
from deferred_ir.scene.motion import FRAMES_PER_SECOND
from deferred_ir.scene.scene import Scene
from deferred_ir.truth import error_picture
from deferred_ir.truth.flip import FlipParameters
from deferred_ir.truth.metrics import compare, masked_relmse

FRAMES = 5
"""Recorded frames of a point; one before them is not recorded."""
OVERHEAD = 16
"""What a frame costs beside its VPLs, in VPLs: for the time left that the progress bar tells."""


@dataclass(frozen=True, eq=False)
class Sweep:
    """What is measured. size: (width, height). shard: (i, n), the i-th of n parts, from 1. peers: their names.

    Peers belong to the first shard. time: seconds, where something moves: frames end there, and errors are of then.
    """

    scene: Scene
    size: tuple[int, int]
    graphs: Sequence[str]
    vpls: Sequence[int]
    seeds: int
    device: str = "auto"
    shard: tuple[int, int] = (1, 1)
    peers: Sequence[str] = ()
    time: float = 0.0

    def __post_init__(self) -> None:
        for name, values in (("--graphs", self.graphs), ("--vpls", self.vpls), ("--seeds", range(self.seeds))):
            if not values:
                raise SettingError(f"{name}: leaves nothing to measure; name one at least")
        hashes: dict[str, str] = {}
        for graph in self.graphs:
            loaded = load_graph(graph, {**self.settings, "vpl.count": max(self.vpls)})
            if "radiance" not in loaded.outputs:
                raise GraphError(f"{graph}: has no output 'radiance', which is held to the reference; add it")
            other = hashes.setdefault(graph_hash(loaded), graph)
            if other != graph:
                raise SettingError(f"--graphs: {other} and {graph} are the same graph; leave one out")
        if not self.shares():
            total = len(self.graphs) * len(self.vpls) * self.seeds
            raise SettingError(f"--shard {self.shard[0]}/{self.shard[1]}: is empty, there are {total} points in all")

    @cached_property
    def moment(self) -> Scene:
        """What errors are of: the scene at `time`, itself where nothing moves."""
        return self.scene.at(self.time)

    def frames(self, plan: Plan) -> list[float]:
        """Times of the frames of a point: first those that do not count, then FRAMES that do, the last at `time`.

        What passes keep from frame to frame is complete by then. Where models move it takes up to twice as long.
        """
        first = plan.frames_to_fill * (1 + self.scene.geometry.moves)
        ahead = range(first + FRAMES - 1, -1, -1)
        return [self.time - i / FRAMES_PER_SECOND if self.scene.moves else 0.0 for i in ahead]

    @property
    def settings(self) -> Mapping[str, Any]:
        """Parameters of passes from the scene file."""
        return self.scene.render.set

    def key(self, graph: str, vpls: int, seed: int) -> Key:
        """What the point depends on."""
        made = load_graph(graph, {**self.settings, "vpl.count": vpls})
        motion = self.scene.hash if self.scene.moves else ""
        return Key(self.moment.hash, graph_hash(made), list(self.size), vpls, seed, motion)

    def shares(self) -> list[tuple[str, int, int]]:
        """(graph, VPLs, seed) of the points of this shard."""
        everything = [(g, n, s) for g in self.graphs for n in self.vpls for s in range(self.seeds)]
        part, parts = self.shard
        return everything[part - 1 :: parts]


def run(sweep: Sweep, folder: Path, reference: Path | None) -> tuple[list[Point], Peers]:
    """Measure what is not in `folder` yet; all points of the sweep's shard."""
    truth = sweep_reference.read(reference, sweep.scene, sweep.size, sweep.time) if reference else None
    gpu = Gpu(sweep.device)
    device = gpu.device.name
    gpu.close()
    points.make_folder(folder)
    if truth is None:
        deciding = {
            "graphs": [sweep.key(graph, max(sweep.vpls), 0).graph_hash for graph in sweep.graphs],
            "device": device,
        }
        with progress_bar() as bar:
            truth = sweep_reference.load_or_trace(
                folder,
                sweep.moment,
                sweep.size,
                deciding,
                images=lambda: _probes(sweep),
                bar=bar,
            )
    with progress_bar() as bar:
        bar.label("edges")
        mask = edge_mask.load_or_find(folder, sweep.moment, sweep.size, bar.show)
    done, ahead = dict[str, Point](), list[tuple[str, int, int]]()
    truth_hash = truth.hash
    for share in sweep.shares():
        name = sweep.key(*share).name
        point = points.read(folder, name)
        if point and point.reference == truth_hash and point.device == device:
            done[name] = points.renamed(point, share[0])
        else:
            ahead.append(share)
    if done:
        print(f"{len(done)} of {len(done) + len(ahead)} points are there already", file=sys.stderr)
    for point in _measured(sweep, folder, truth, mask, ahead):
        done[point.key.name] = point
    peers = Peers()
    if sweep.peers and sweep.shard[0] == 1:
        course = ladder.Course(sweep.moment, sweep.size, sweep.seeds, truth, mask)
        peers = ladder.run(course, folder, sweep.peers)
    return points.ordered(done.values()), peers


def _measured(
    sweep: Sweep, folder: Path, truth: Truth, mask: Mask, ahead: Sequence[tuple[str, int, int]]
) -> Iterator[Point]:
    """Measure and keep the points `ahead`, with a bar on a terminal."""
    flip_parameters = FlipParameters.from_reference(truth.radiance)
    total = sum(vpls + OVERHEAD for _, vpls, _ in ahead)
    with progress_bar(total=total) as bar:
        for graph in dict.fromkeys(graph for graph, _, _ in ahead):
            with Renderer(sweep.size, graph, sweep.device, set=sweep.settings) as renderer:
                for _, vpls, seed in (share for share in ahead if share[0] == graph):
                    bar.label(f"{graph}, {vpls} VPLs, seed {seed}")
                    key = sweep.key(graph, vpls, seed)
                    yield _measure(
                        sweep, folder, renderer, truth, mask, flip_parameters=flip_parameters, key=key, graph=graph
                    )
                    bar.advance(vpls + OVERHEAD)


def _measure(
    sweep: Sweep,
    folder: Path,
    renderer: Renderer,
    truth: Truth,
    mask: Mask,
    *,
    flip_parameters: FlipParameters,
    key: Key,
    graph: str,
) -> Point:
    scene = sweep.scene
    images = [name for name in renderer.graph(key.vpls).outputs if name in IMAGES]
    plan = renderer.plan(scene, key.vpls, images)
    measurement = Measurement()
    times = sweep.frames(plan)
    for i, time in enumerate(times):  # the first compiles, allocates: not what a frame costs
        renderer.draw(
            scene, plan, seed=key.seed, time=time, measurement=measurement if i >= len(times) - FRAMES else None
        )
    image = renderer.read(plan)
    renderer.finish(measurement)
    names = (f"{graph}, {key.vpls} VPLs, seed {key.seed}", "the reference")
    result = compare(image.radiance, truth.radiance, truth.hit, names=names, flip_parameters=flip_parameters)
    pictures = key.seed == 0 and image.display is not None
    if pictures:
        display, error = (points.path(folder, key.name, suffix) for suffix in points.PICTURES)
        image.save(display)
        errors = error_picture.measure_signed_errors(image.radiance, truth.radiance, result.reference_mean)
        error_picture.save(error, errors)
    memory, alive = renderer.memory(), measurement.counters[-1].get("vpls_alive", 0)
    left_out = savings.list_for_frames(renderer, plan, measurement)
    left_out += savings.measure_passes(renderer, sweep.moment, plan, vpls=key.vpls, seed=key.seed)
    point = Point(
        key=key,
        scene=scene.name,
        graph=graph,
        reference=truth.hash,
        reference_noise=truth.noise,
        device=renderer.gpu.device.name,
        software=renderer.gpu.device.kind == "software",
        vpls_alive=alive,
        frames=[round(ms, 4) for ms in measurement.frame_ms],
        laps=[[(name, round(gpu, 4), round(cpu, 4)) for name, (gpu, cpu) in laps.items()] for laps in measurement.laps],
        memory=memory,
        left_out=left_out,
        time=sweep.time if scene.moves else None,
        relmse=result.relmse,
        relmse_untrimmed=result.relmse_untrimmed,
        bias=result.bias,
        relmse_masked=masked_relmse(image.radiance, truth.radiance, mask.kept),
        flip=result.flip,
        flip_note=result.flip_note,
        flip_parameters=asdict(flip_parameters) if result.flip is not None else None,
        pictures=pictures,
    )
    points.save(folder, point)
    return point


def _probes(sweep: Sweep) -> list[Array]:
    """An image of each graph with the most VPLs. The same in all shards, which so agree on a reference."""
    images = []
    for graph in sweep.graphs:
        with Renderer(sweep.size, graph, sweep.device, set=sweep.settings) as renderer:
            plan = renderer.plan(sweep.scene, max(sweep.vpls), ["radiance"])
            for time in sweep.frames(plan):
                renderer.draw(sweep.scene, plan, time=time)
            images.append(renderer.read(plan).radiance)
    return images
