"""Points of a sweep grouped by graph and number of VPLs, the Pareto front, and a recommendation.

Graphs that retain samples of earlier frames are neither on the front nor recommended: the time of one of their frames
is not what its image took.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from statistics import mean

from deferred_ir.profiling.sweep.points import Point
from deferred_ir.profiling.sweep.reference import MOST_NOISE

BUDGET = 50.0
"""Milliseconds a frame for which the report recommends settings."""
SAME = 0.01
"""Relative difference of errors below which a slower choice is not on the Pareto front."""


@dataclass(frozen=True)
class Group:
    """All seeds of a graph and a number of VPLs: means, and the smallest and largest relMSE. Times in milliseconds.

    frames_to_fill: frames before the measured ones in which the graph fills its state; 1 without state.
    retains_samples: whether images hold samples of earlier frames.
    """

    graph: str
    vpls: int
    seeds: int
    frame_ms: float
    relmse: float
    relmse_low: float
    relmse_high: float
    flagged: bool
    frames_to_fill: int = 1
    retains_samples: bool = False
    pareto: bool = False


def is_flagged(point: Point) -> bool:
    """Return whether the reference's own noise is unknown, or too large beside this point's error."""
    return is_noisy(point.reference_noise, point.relmse)


def is_noisy(noise: float | None, error: float) -> bool:
    """Return whether a reference's noise (a relMSE, None if unknown) is too large to measure such an error."""
    return noise is None or noise > MOST_NOISE * error


def group_points(points: Iterable[Point], *, masked: bool = False) -> list[Group]:
    """Group points by graph and number of VPLs, and mark the groups on the Pareto front.

    masked: use the errors of the pixels without an edge inside; points without such pixels are left out.
    """
    seeds: dict[tuple[str, int], list[tuple[Point, float]]] = {}
    for point in points:
        error = point.relmse_masked if masked else point.relmse
        if error is not None:
            seeds.setdefault((point.graph, point.key.vpls), []).append((point, error))
    groups = [_make_group(graph, vpls, members) for (graph, vpls), members in seeds.items()]
    front = [group for group in groups if not group.retains_samples]
    front = [group for group in front if not any(_beats(other, group) for other in front)]
    return [replace(group, pareto=group in front) for group in groups]


def _make_group(graph: str, vpls: int, members: Sequence[tuple[Point, float]]) -> Group:
    errors = [error for _, error in members]
    return Group(
        graph,
        vpls,
        seeds=len(members),
        frame_ms=round(mean(point.frame_ms for point, _ in members), 4),
        relmse=mean(errors),
        relmse_low=min(errors),
        relmse_high=max(errors),
        flagged=any(is_noisy(point.reference_noise, error) for point, error in members),
        frames_to_fill=max(point.frames_to_fill for point, _ in members),
        retains_samples=any(point.retains_samples for point, _ in members),
    )


def _beats(other: Group, group: Group) -> bool:
    """Return whether `other` is faster and not worse, or as fast and better.

    Graphs of the same lights differ by rounding errors, which are no gain.
    """
    if other.frame_ms == group.frame_ms:
        return other.relmse < group.relmse
    return other.frame_ms < group.frame_ms and other.relmse <= (1 + SAME) * group.relmse


def advise(groups: Sequence[Group], budget: float = BUDGET) -> str:
    """Return a sentence that recommends a graph and a number of VPLs for `budget` milliseconds a frame."""
    groups = [group for group in groups if not group.retains_samples]
    if not groups:
        return "No recommendation: the time of a frame that retains samples of earlier ones is not that of an image."
    within = [group for group in groups if group.frame_ms <= budget]
    if within:
        least = min(group.relmse for group in within)
        # The fastest of the choices that are as good as the best, rounding aside.
        best = min((g for g in within if g.relmse <= least * (1 + SAME)), key=lambda group: group.frame_ms)
        start = f"For {budget:g} ms: "
    else:
        best = min(groups, key=lambda group: group.frame_ms)
        start = f"Nothing here takes {budget:g} ms or less; the fastest: "
    doubt = "; the noise of the reference is not small beside that" if best.flagged else ""
    return f"{start}{best.graph}, {best.vpls} VPLs, relMSE {best.relmse:.2g} in {best.frame_ms:.3g} ms{doubt}."
