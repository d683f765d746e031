"""Points dealt to the pixels of a block: every window has them all, and they cover the square evenly."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from deferred_ir.sampling import pixel_blocks


@given(
    block=st.sampled_from([1, 2, 4, 8]),
    samples=st.floats(0.25, 16),
    x=st.integers(0, 40),
    y=st.integers(0, 40),
    turn=st.integers(0, 63),
)
def test_every_window_of_a_block_has_each_cell_once(block, samples, x, y, turn):
    columns, rows = np.meshgrid(np.arange(x, x + block), np.arange(y, y + block))
    traced, index, total = pixel_blocks.deal((rows * 64 + columns).ravel(), 64, samples, block, turn % block**2)
    np.testing.assert_array_equal(np.sort(index.ravel()), np.arange(total))
    assert total == len(traced) * index.shape[1]
    assert total >= max(round(samples * block * block), 1) or samples > 1


@pytest.mark.parametrize("count", [1, 2, 3, 7, 16, 64, 256])
def test_cells_tile_the_square(count):
    """If cells overlapped or left gaps, points drawn evenly from all would not be even."""
    grid = pixel_blocks.find_lattice(count)
    steps = grid[2].astype(float)
    assert abs(np.linalg.det(steps)) * count == pytest.approx(1, rel=1e-4)
    each = 160_000 // count
    points = pixel_blocks.jitter(np.repeat(np.arange(count), each), grid, np.random.default_rng(3))
    assert ((points >= 0) & (points < 1)).all()
    cells, _, _ = np.histogram2d(*points.T, bins=8, range=[[0, 1], [0, 1]])
    np.testing.assert_allclose(cells, len(points) / 64, rtol=0.12)
