"""Points of a sweep grouped by graph and number of VPLs, the Pareto front, and a recommendation.

Graphs that retain samples of earlier frames are neither on the front nor recommended: the time of one of their frames
is not what its image took.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from statistics import mean

from deferred_ir.profiling.figures import format_ms
from deferred_ir.profiling.sweep.points import Point
from deferred_ir.truth.reference_noise import ReferenceNoise

BUDGET = 50.0
"""Milliseconds a frame for which the report recommends settings."""
SAME = 0.01
"""Relative difference of errors below which a slower choice is not on the Pareto front."""


@dataclass(frozen=True)
class Group:
    """All seeds of a graph and a number of VPLs: means, and the smallest and largest relMSE. Times in milliseconds.

    noise: of the reference. frames_to_fill: frames before the measured ones in which the graph fills its state; 1
    without state. retains_samples: whether images hold samples of earlier frames.
    """

    graph: str
    vpls: int
    seeds: int
    frame_ms: float
    relmse: float
    relmse_low: float
    relmse_high: float
    noise: ReferenceNoise
    frames_to_fill: int = 1
    retains_samples: bool = False
    pareto: bool = False

    @property
    def level(self) -> float:
        """The relMSE to choose by: all that the reference's noise hides are alike."""
        return self.noise.level(self.relmse)


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
        noise=members[0][0].reference_about.noise,
        frames_to_fill=max(point.frames_to_fill for point, _ in members),
        retains_samples=any(point.retains_samples for point, _ in members),
    )


def _beats(other: Group, group: Group) -> bool:
    """Return whether `other` is faster and not worse, or as fast and better.

    Graphs of the same lights differ by rounding errors, which are no gain.
    """
    if other.frame_ms == group.frame_ms:
        return other.level < group.level
    return other.frame_ms < group.frame_ms and other.level <= (1 + SAME) * group.level


def advise(groups: Sequence[Group], size: Sequence[int], budget: float = BUDGET) -> str:
    """Return a sentence that recommends a graph and a number of VPLs for images of `size` in `budget` milliseconds."""
    groups = [group for group in groups if not group.retains_samples]
    if not groups:
        return "No recommendation: the time of a frame that retains samples of earlier ones is not that of an image."
    within = [group for group in groups if group.frame_ms <= budget]
    for_budget = f"{format_ms(budget)} at {size[0]}x{size[1]}"
    if within:
        least = min(group.level for group in within)
        # The fastest of the choices that are as good as the best, rounding aside.
        best = min((g for g in within if g.level <= least * (1 + SAME)), key=lambda group: group.frame_ms)
        start = f"For {for_budget}: "
    else:
        best = min(groups, key=lambda group: group.frame_ms)
        start = f"Nothing here takes {for_budget} or less; the fastest: "
    noise = best.noise
    doubt = ""
    if noise.hides(best.relmse):
        doubt = "; that is the noise of the reference, so better settings cannot be told apart"
    elif noise.flag(best.relmse):
        share = "unknown" if noise.relmse is None else f"{noise.relmse / best.relmse:.0%} of that"
        doubt = f"; the noise of the reference is {share}"
    error = noise.quote(best.relmse, 2)
    return f"{start}{best.graph}, {best.vpls} VPLs, relMSE {error} in {format_ms(best.frame_ms)}{doubt}."
