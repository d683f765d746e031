"""Sample patterns lie in the unit square, are repeatable, and are spread evenly."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import kstest, qmc

from deferred_ir.sampling.patterns import PATTERNS, sample_unit_square

COUNTS = (0, 1, 2, 3, 5, 7, 16, 60, 64, 100, 255, 1000)


@pytest.mark.parametrize("pattern", PATTERNS)
@pytest.mark.parametrize("count", COUNTS)
def test_points_lie_in_the_half_open_unit_square(pattern, count):
    points = sample_unit_square(pattern, count, 3)
    assert points.shape == (count, 2)
    assert points.dtype == np.float64
    assert ((points >= 0) & (points < 1)).all()


@pytest.mark.parametrize("pattern", PATTERNS)
def test_the_same_seed_gives_the_same_points_and_another_seed_others(pattern):
    first = sample_unit_square(pattern, 64, 0).copy()
    sample_unit_square.cache_clear()
    np.testing.assert_array_equal(sample_unit_square(pattern, 64, 0), first)
    assert not np.array_equal(sample_unit_square(pattern, 64, 1), first)


@pytest.mark.parametrize("pattern", PATTERNS)
def test_the_cached_points_cannot_be_spoilt(pattern):
    with pytest.raises(ValueError, match="read-only"):
        sample_unit_square(pattern, 4, 0)[0, 0] = 2


@pytest.mark.parametrize("pattern", PATTERNS)
def test_points_are_uniform_over_seeds(pattern):
    """No pattern prefers a place, whatever the count."""
    points = np.concatenate([sample_unit_square(pattern, 6, seed) for seed in range(400)])
    for axis in range(2):
        assert kstest(points[:, axis], "uniform").pvalue > 1e-3


@pytest.mark.parametrize("pattern", ["stratified", "halton", "sobol"])
@pytest.mark.parametrize("count", [60, 64, 256])
def test_patterns_are_spread_more_evenly_than_chance(pattern, count):
    discrepancy = np.median([qmc.discrepancy(sample_unit_square(pattern, count, seed)) for seed in range(5)])
    chance = np.median([qmc.discrepancy(sample_unit_square("random", count, seed)) for seed in range(5)])
    assert discrepancy < 0.5 * chance


@given(st.integers(1, 700), st.integers(0, 50))
def test_each_stratified_point_has_a_cell_of_equal_area_to_itself(count, seed):
    """Rows of cells that tile the square: `rows` is read off the points, which come row by row."""
    points = sample_unit_square("stratified", count, seed)
    rows = max(1, round(np.sqrt(count)))
    per_row = np.diff(np.arange(rows + 1) * count // rows)
    assert per_row.min() >= 1
    assert per_row.max() - per_row.min() <= 1
    edge, start = 0.0, 0
    for n in per_row:
        height = n / count  # so that each of its n cells has the area 1 / count
        row = points[start : start + n]
        assert (row[:, 1] >= edge - 1e-12).all()
        assert (row[:, 1] <= edge + height + 1e-12).all()
        np.testing.assert_array_equal(np.floor(row[:, 0] * n).astype(int), np.arange(n))
        edge, start = edge + height, start + n
    assert edge == pytest.approx(1)


def test_stratified_cells_are_squares_where_the_count_is_one():
    cells = np.floor(sample_unit_square("stratified", 400, 0) * 20).astype(int)
    assert len({tuple(cell) for cell in cells}) == 400


@pytest.mark.parametrize("m", [0, 1, 4, 6, 10])
def test_sobol_points_are_stratified_in_each_elementary_interval(m):
    points = sample_unit_square("sobol", 2**m, 5)
    for k in range(m + 1):
        cells = np.floor(points * (2**k, 2 ** (m - k))).astype(int)
        assert len({tuple(cell) for cell in cells}) == 2**m
