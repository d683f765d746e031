"""Sample patterns in the unit square and systematic resampling.

Sources: Owen 1998, Joe and Kuo 2008 through scipy.stats.qmc (scrambled Sobol
and Halton).
"""

from __future__ import annotations

import logging
from functools import lru_cache
from typing import Literal, get_args

import numpy as np

from deferred_ir.base.arrays import Array, Ints
from deferred_ir.sampling.warps import square_to_disc

log = logging.getLogger("deferred_ir")
Pattern = Literal["random", "stratified", "halton", "sobol"]
PATTERNS: tuple[str, ...] = get_args(Pattern)


@lru_cache(maxsize=8)
def sample_unit_square(pattern: Pattern, count: int, seed: int) -> Array:
    """Return `count` points in [0, 1)^2, float64 (count, 2), the same for the same arguments; cached, so read-only."""
    points = _points(pattern, count, seed)
    points.flags.writeable = False
    return points


@lru_cache(maxsize=8)
def sample_unit_disc(pattern: Pattern, count: int, seed: int) -> Array:
    """Return the points of `sample_unit_square` mapped to the unit disc; cached for repeated seeds, so read-only."""
    points = square_to_disc(sample_unit_square(pattern, count, seed))
    points.flags.writeable = False
    return points


def warn_unbalanced(pattern: Pattern, count: int) -> None:
    """Log a warning if `count` points of a Sobol set are not balanced: only powers of two are."""
    if pattern == "sobol" and count & (count - 1):
        whole = 1 << count.bit_length()
        log.warning(
            "sobol: %d points are not balanced, only powers of two are; take %d or %d", count, whole // 2, whole
        )


def _points(pattern: Pattern, count: int, seed: int) -> Array:
    rng = np.random.default_rng(seed)
    if count == 0 or pattern == "random":
        return rng.random((count, 2))
    if pattern == "stratified":
        return _stratified(count, rng)
    from scipy.stats import qmc

    if pattern == "halton":
        return np.asarray(qmc.Halton(2, rng=rng).random(count))
    # Draw all 2^m points: SciPy would warn about other counts, and warn_unbalanced has already.
    points: Array = qmc.Sobol(2, rng=rng).random_base2(int(np.ceil(np.log2(count))))[:count]
    return points


def _stratified(count: int, rng: np.random.Generator) -> Array:
    """Return a jittered point in each of `count` cells of equal area, in rows, so that any count works."""
    rows = max(1, round(np.sqrt(count)))
    per_row = np.diff(np.arange(rows + 1) * count // rows)
    row = np.repeat(np.arange(rows), per_row)
    column = np.arange(count) - np.repeat(np.cumsum(per_row) - per_row, per_row)
    # A row is as high as its share of the points, so all cells have the same area.
    heights = per_row / count
    tops = np.cumsum(heights) - heights
    u = (column + rng.random(count)) / per_row[row]
    v = tops[row] + heights[row] * rng.random(count)
    points: Array = np.minimum(np.stack([u, v], axis=1), np.nextafter(1, 0))
    return points


def resample_systematically(weights: Array, count: int, offset: float) -> Ints:
    """Draw `count` indices, each count * weight / sum(weights) times, rounded up or down (systematic resampling).

    Indices ascend. `offset`, uniform in [0, 1), makes it unbiased. Some weight must be above 0.
    """
    ends = np.cumsum(weights)
    ticks = (np.arange(count) + offset) / count * ends[-1]
    drawn: Ints = np.minimum(np.searchsorted(ends, ticks, side="right"), len(weights) - 1)
    return drawn
