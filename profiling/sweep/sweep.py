"""What a sweep measures: graphs x numbers of VPLs x seeds, of one scene."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from deferred_ir.base.errors import GraphError, SettingError
from deferred_ir.engine.settings import choose_settings
from deferred_ir.graph.file import graph_hash, load_graph
from deferred_ir.graph.graph import Plan
from deferred_ir.profiling.sweep.points import Key
from deferred_ir.profiling.sweep.reference import MOST_SPP
from deferred_ir.scene.motion import FRAMES_PER_SECOND
from deferred_ir.scene.scene import Scene

FRAMES = 5
"""Measured frames of a point."""

Task = tuple[str, int, int]
"""A point to measure: (graph, number of VPLs, seed)."""


@dataclass(frozen=True, eq=False)
class Sweep:
    """The points to measure. size: (width, height). shard: (i, n), the i-th of n parts, from 1. peers: their names.

    The first shard measures the peers. time: seconds; where something moves, the frames end there and errors are of
    that time. most_spp: most paths a pixel of a reference that is traced. Raises SettingError or GraphError if there is
    nothing to measure, or a graph cannot run or be compared.
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
    most_spp: int = MOST_SPP
    _hashes: dict[tuple[str, int], str] = field(default_factory=dict, init=False, repr=False)
    """Hashes of graphs by their names and numbers of VPLs."""

    def __post_init__(self) -> None:
        for name, values in (("--graphs", self.graphs), ("--vpls", self.vpls), ("--seeds", range(self.seeds))):
            if not values:
                raise SettingError(f"{name}: leaves nothing to measure; name one at least")
        names: dict[str, str] = {}
        for graph in self.graphs:
            loaded = load_graph(graph, self.settings)
            if obstacle := loaded.find_obstacle():
                raise GraphError(obstacle)
            if "radiance" not in loaded.outputs:
                raise GraphError(f"{graph}: has no output 'radiance', which is compared with the reference; add it")
            other = names.setdefault(self.graph_hash(graph, max(self.vpls)), graph)
            if other != graph:
                raise SettingError(f"--graphs: {other} and {graph} are the same graph; leave one out")
        if not self.tasks():
            total = len(self.graphs) * len(self.vpls) * self.seeds
            raise SettingError(f"--shard {self.shard[0]}/{self.shard[1]}: is empty, there are {total} points in all")

    @cached_property
    def moment(self) -> Scene:
        """The scene at `time`, of which the errors are; the scene itself if nothing moves."""
        return self.scene.at(self.time)

    def frame_times(self, plan: Plan) -> list[float]:
        """Return the time of each frame of a point: first unmeasured ones, then FRAMES measured ones, to `time`.

        Passes that retain state between frames have filled it by then. Where models move, filling takes up to twice
        as many frames.
        """
        first = plan.frames_to_fill * (1 + self.scene.geometry.moves)
        ahead = range(first + FRAMES - 1, -1, -1)
        return [self.time - i / FRAMES_PER_SECOND if self.scene.moves else 0.0 for i in ahead]

    @property
    def settings(self) -> Mapping[str, Any]:
        """Parameters of passes from the scene file."""
        return self.scene.render.set

    def graph_hash(self, graph: str, vpls: int) -> str:
        """Return the hash of a graph with a number of VPLs."""
        if (graph, vpls) not in self._hashes:
            settings = choose_settings(graph, self.scene.render, {}, vpls)
            self._hashes[graph, vpls] = graph_hash(load_graph(graph, settings))
        return self._hashes[graph, vpls]

    def key(self, graph: str, vpls: int, seed: int) -> Key:
        """Return the key of a point."""
        motion = self.scene.hash if self.scene.moves else ""
        return Key(self.moment.hash, self.graph_hash(graph, vpls), list(self.size), vpls, seed, motion)

    def tasks(self) -> list[Task]:
        """List the points of this shard."""
        everything = [(g, n, s) for g in self.graphs for n in self.vpls for s in range(self.seeds)]
        part, parts = self.shard
        return everything[part - 1 :: parts]
