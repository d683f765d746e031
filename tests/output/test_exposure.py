"""Automatic exposure on the CPU is that of the tone map."""

from __future__ import annotations

import numpy as np
import pytest

from deferred_ir.output.exposure import GRID, compute_stops


@pytest.mark.parametrize("size", [(1, 1), (5, 3), (GRID, GRID), (200, 150)])
def test_a_grey_image_is_brought_to_middle_grey(size):
    assert compute_stops(np.full((*size, 3), 0.09, np.float32)) == pytest.approx(1.0)


def test_what_is_not_lit_does_not_count():
    half = np.zeros((20, 20, 3))
    half[:, 10:] = 0.36
    assert compute_stops(half) == pytest.approx(-1.0)
    assert compute_stops(np.zeros((20, 20, 3))) == 0.0
