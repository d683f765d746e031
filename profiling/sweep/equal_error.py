"""The time that renderers need for the same error, interpolated between measured points and never extrapolated.

Graphs that retain samples of earlier frames are left out: their frame times are those of a filled set, and a single
image would take all the frames before as well.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import pairwise
from statistics import mean
from typing import Any

from deferred_ir.profiling.figures import format_ms
from deferred_ir.profiling.peers.points import PeerPoint
from deferred_ir.profiling.sweep.groups import Group
from deferred_ir.truth.reference_noise import ReferenceNoise

TARGETS = (0.1, 0.03, 0.01, 0.003)
"""Masked relMSE for which times are given."""


@dataclass(frozen=True)
class Rung:
    """All seeds of a peer and a number of paths a pixel: mean time [ms], mean masked relMSE and its range."""

    peer: str
    spp: int
    seeds: int
    ms: float
    relmse: float
    relmse_low: float
    relmse_high: float
    about: str


@dataclass(frozen=True)
class Reach:
    """The time `ms` that a graph or peer needs for an error.

    at_most: its fastest point is already better, so `ms` is an upper bound. ms: None if it never reaches the error;
    then `floor` is its least measured error and `beyond` the time of that.
    """

    name: str
    ms: float | None
    at_most: bool
    floor: float
    beyond: float

    def __str__(self) -> str:
        """Format for a table."""
        if self.ms is None:
            return f"not reached, floor = {self.floor:.2g}"
        return f"{'at most ' if self.at_most else ''}{format_ms(self.ms)}"


@dataclass(frozen=True)
class Row:
    """One error. ours: the time of our fastest graph, None if none was measured.

    flagged: by the reference's noise, see `ReferenceNoise.flag`. An error that it hides has no times.
    """

    relmse: float
    ours: Reach | None
    peers: Mapping[str, Reach]
    flagged: str

    def as_dict(self) -> dict[str, Any]:
        """Return plain data for JSON."""
        return {**asdict(self), "speedup": {peer: self.speedup(peer) or None for peer in self.peers}}

    def speedup(self, peer: str) -> str:
        """Format how many times as long the peer takes for a table; empty if it is unknown."""
        ours, theirs = self.ours, self.peers.get(peer)
        if ours is None or ours.ms is None or theirs is None:
            return ""
        if theirs.ms is None:
            return f"over {theirs.beyond / ours.ms:.3g}x"
        if ours.at_most and theirs.at_most:
            return ""
        bound = "at least " if ours.at_most else "at most " if theirs.at_most else ""
        return f"{bound}{theirs.ms / ours.ms:.3g}x"


def group_rungs(points: Iterable[PeerPoint]) -> list[Rung]:
    """Group points by peer and number of paths. Points without a masked error are left out."""
    seeds: dict[tuple[str, int], list[PeerPoint]] = {}
    for point in points:
        seeds.setdefault((point.key.peer, point.key.spp), []).append(point)
    rungs = []
    for (peer, spp), members in seeds.items():
        errors = [point.relmse_masked for point in members if point.relmse_masked is not None]
        if errors:
            ms = round(mean(point.ms for point in members), 4)
            about = members[0].about
            rungs.append(Rung(peer, spp, len(members), ms, mean(errors), min(errors), max(errors), about))
    return rungs


def find_front(choices: Iterable[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return the Pareto front of (time, error), by time: errors fall along it."""
    front: list[tuple[float, float]] = []
    for ms, error in sorted(choices):
        if not front or error < front[-1][1]:
            front.append((ms, error))
    return front


def reach(name: str, choices: Iterable[tuple[float, float]], target: float) -> Reach:
    """Find when the front of (time, error), at least one, reaches `target`: linear between two points in logarithms."""
    line = find_front(choices)
    beyond, floor = line[-1]
    ms, at_most = None, line[0][1] <= target
    if at_most:
        ms = line[0][0]
    for (fast, worse), (slow, better) in pairwise(line):
        if better <= target < worse:
            # An error of 0 has no logarithm; every target is reached at the slower point then.
            part = math.log(worse / target) / math.log(worse / better) if better > 0 else 1.0
            ms = fast * (slow / fast) ** part
    return Reach(name, ms, at_most, floor, beyond)


def find_retaining(groups: Iterable[Group]) -> dict[str, int]:
    """Return the graphs that retain samples of earlier frames, and how many frames fill their state at most."""
    fills: dict[str, int] = {}
    for group in groups:
        if group.retains_samples:
            fills[group.graph] = max(group.frames_to_fill, fills.get(group.graph, 1))
    return fills


def rows(
    groups: Sequence[Group], peers: Sequence[Rung], noise: ReferenceNoise, targets: Sequence[float] = TARGETS
) -> list[Row]:
    """Return the table, empty without peers. groups: with masked errors. noise: of the reference."""
    ours: dict[str, list[tuple[float, float]]] = {}
    for group in groups:
        if group.retains_samples:
            continue
        ours.setdefault(group.graph, []).append((group.frame_ms, group.relmse))
    theirs: dict[str, list[tuple[float, float]]] = {}
    for rung in peers:
        theirs.setdefault(rung.peer, []).append((rung.ms, rung.relmse))
    if not theirs:
        return []
    return [
        Row(target, None, {}, noise.flag(target))
        if noise.hides(target)
        else Row(
            target,
            _best([reach(graph, choices, target) for graph, choices in ours.items()]),
            {peer: reach(peer, choices, target) for peer, choices in theirs.items()},
            noise.flag(target),
        )
        for target in targets
    ]


def _best(reaches: Sequence[Reach]) -> Reach | None:
    """Return the fastest that reaches the error, else the one with the lowest floor."""
    if not reaches:
        return None
    return min(reaches, key=lambda one: (one.ms is None, one.floor if one.ms is None else one.ms))
