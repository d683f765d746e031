"""The time that renderers need for the same error, read off what was measured: interpolated, never extrapolated."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import pairwise
from statistics import mean
from typing import Any

from deferred_ir.profiling.peers.points import PeerPoint
from deferred_ir.profiling.sweep.groups import Group, noisy

TARGETS = (0.1, 0.03, 0.01, 0.003)
"""Masked relMSE for which times are given."""


@dataclass(frozen=True)
class Rung:
    """All seeds of a peer and a number of paths a pixel: means of time [ms] and masked relMSE, and that one's range."""

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
    """The time at which a front has an error: `ms`, or at most that if even its fastest choice is better.

    Where it never is as good, ms is None, `floor` the least error that was measured and `beyond` the time of that.
    """

    name: str
    ms: float | None
    at_most: bool
    floor: float
    beyond: float

    def __str__(self) -> str:
        """As a table shows it."""
        if self.ms is None:
            return f"not reached, floor = {self.floor:.2g}"
        return f"{'at most ' if self.at_most else ''}{self.ms:.3g} ms"


@dataclass(frozen=True)
class Row:
    """One error. ours: of our fastest graph at it, None where nothing of ours was measured. noisy: the reference is."""

    relmse: float
    ours: Reach | None
    peers: Mapping[str, Reach]
    noisy: bool

    def as_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return {**asdict(self), "speedup": {peer: self.speedup(peer) or None for peer in self.peers}}

    def speedup(self, peer: str) -> str:
        """How many times as long the peer takes, as a table shows it; empty where that cannot be told."""
        ours, theirs = self.ours, self.peers[peer]
        if ours is None or ours.ms is None:
            return ""
        if theirs.ms is None:
            return f"over {theirs.beyond / ours.ms:.3g}x"
        if ours.at_most and theirs.at_most:
            return ""
        bound = "at least " if ours.at_most else "at most " if theirs.at_most else ""
        return f"{bound}{theirs.ms / ours.ms:.3g}x"


def rungs(points: Iterable[PeerPoint]) -> list[Rung]:
    """Points by peer and paths, without those of scenes in which no pixel counts."""
    seeds: dict[tuple[str, int], list[PeerPoint]] = {}
    for point in points:
        seeds.setdefault((point.key.peer, point.key.spp), []).append(point)
    made = []
    for (peer, spp), many in seeds.items():
        errors = [point.relmse_masked for point in many if point.relmse_masked is not None]
        if errors:
            ms = round(mean(point.ms for point in many), 4)
            made.append(Rung(peer, spp, len(many), ms, mean(errors), min(errors), max(errors), about=many[0].about))
    return made


def front(choices: Iterable[tuple[float, float]]) -> list[tuple[float, float]]:
    """Of (time, error) those that nothing as fast or faster beats, by time: errors fall along it."""
    kept: list[tuple[float, float]] = []
    for ms, error in sorted(choices):
        if not kept or error < kept[-1][1]:
            kept.append((ms, error))
    return kept


def reach(name: str, choices: Iterable[tuple[float, float]], target: float) -> Reach:
    """When `target` is reached along the front of at least one (time, error); straight between two of it in logs."""
    line = front(choices)
    beyond, floor = line[-1]
    ms, at_most = None, line[0][1] <= target
    if at_most:
        ms = line[0][0]
    for (fast, worse), (slow, better) in pairwise(line):
        if better <= target < worse:
            # An error of 0 has no logarithm, and then everything between the two is at it.
            part = math.log(worse / target) / math.log(worse / better) if better > 0 else 1.0
            ms = fast * (slow / fast) ** part
    return Reach(name, ms, at_most, floor, beyond)


def rows(
    groups: Sequence[Group], peers: Sequence[Rung], noise: float | None, targets: Sequence[float] = TARGETS
) -> list[Row]:
    """The table, empty without peers. groups: with masked errors. noise: the reference's own relMSE."""
    ours: dict[str, list[tuple[float, float]]] = {}
    for group in groups:
        ours.setdefault(group.graph, []).append((group.frame_ms, group.relmse))
    theirs: dict[str, list[tuple[float, float]]] = {}
    for rung in peers:
        theirs.setdefault(rung.peer, []).append((rung.ms, rung.relmse))
    if not theirs:
        return []
    return [
        Row(
            target,
            _best([reach(graph, choices, target) for graph, choices in ours.items()]),
            {peer: reach(peer, choices, target) for peer, choices in theirs.items()},
            noisy(noise, target),
        )
        for target in targets
    ]


def _best(found: Sequence[Reach]) -> Reach | None:
    """The fastest that reaches it, else the one with the lowest floor."""
    if not found:
        return None
    return min(found, key=lambda one: (one.ms is None, one.floor if one.ms is None else one.ms))
