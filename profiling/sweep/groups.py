"""Points of a sweep by graph and number of VPLs, the best of them, and what to take."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from statistics import mean

from deferred_ir.profiling.sweep.points import Point
from deferred_ir.profiling.sweep.reference import SHARE

BUDGET = 50.0
"""Milliseconds for which the page gives advice."""
SAME = 0.01
"""Relative difference of errors below which a slower choice is not on the Pareto front."""


@dataclass(frozen=True)
class Group:
    """All seeds of a graph and a number of VPLs: means, and the smallest and largest relMSE. Times in milliseconds."""

    graph: str
    vpls: int
    seeds: int
    frame_ms: float
    relmse: float
    relmse_low: float
    relmse_high: float
    flagged: bool
    pareto: bool = False


def flagged(point: Point) -> bool:
    """The reference's own noise is too large beside this error, or unknown."""
    return noisy(point.reference_noise, point.relmse)


def noisy(noise: float | None, error: float) -> bool:
    """Whether a reference of that `noise` (a relMSE, None if unknown) is no judge of such an `error`."""
    return noise is None or noise > SHARE * error


def grouped(found: Iterable[Point], *, masked: bool = False) -> list[Group]:
    """Points by graph and number of VPLs, those on the Pareto front marked.

    masked: with the errors of the pixels that have no edge inside; points without such pixels are left out.
    """
    seeds: dict[tuple[str, int], list[tuple[Point, float]]] = {}
    for point in found:
        error = point.relmse_masked if masked else point.relmse
        if error is not None:
            seeds.setdefault((point.graph, point.key.vpls), []).append((point, error))
    groups = []
    for (graph, vpls), many in seeds.items():
        errors = [error for _, error in many]
        time = round(mean(point.frame_ms for point, _ in many), 4)
        doubtful = any(noisy(point.reference_noise, error) for point, error in many)
        groups.append(Group(graph, vpls, len(many), time, mean(errors), min(errors), max(errors), doubtful))
    return [replace(group, pareto=not any(_beats(other, group) for other in groups)) for group in groups]


def _beats(other: Group, group: Group) -> bool:
    """Faster and not worse, or as fast and better. Graphs of the same lights differ by roundings, which are no gain."""
    if other.frame_ms == group.frame_ms:
        return other.relmse < group.relmse
    return other.frame_ms < group.frame_ms and other.relmse <= (1 + SAME) * group.relmse


def advise(groups: Sequence[Group], budget: float = BUDGET) -> str:
    """Which graph and how many VPLs to take for `budget` milliseconds, in a sentence."""
    within = [group for group in groups if group.frame_ms <= budget]
    if within:
        least = min(group.relmse for group in within)
        # Of choices as good as each other, rounding aside, the fastest.
        best = min((g for g in within if g.relmse <= least * (1 + SAME)), key=lambda group: group.frame_ms)
        start = f"For {budget:g} ms: "
    else:
        best = min(groups, key=lambda group: group.frame_ms)
        start = f"Nothing here takes {budget:g} ms or less; the fastest: "
    doubt = "; the noise of the reference is not small beside that" if best.flagged else ""
    return f"{start}{best.graph}, {best.vpls} VPLs, relMSE {best.relmse:.2g} in {best.frame_ms:.3g} ms{doubt}."
