"""The Hilbert curve: it visits every cell once, in steps to a neighbour."""

import numpy as np
import pytest

from deferred_ir.sampling.hilbert import find_hilbert_order


@pytest.mark.parametrize(("dimensions", "bits"), [(1, 5), (2, 1), (2, 4), (3, 1), (3, 3), (4, 2), (6, 2)])
def test_each_step_is_to_a_neighbour(dimensions, bits):
    side = 2**bits
    cells = np.indices((side,) * dimensions).reshape(dimensions, -1).T
    order = find_hilbert_order((cells + 0.5) / side, bits)
    assert sorted(order) == list(range(len(cells)))
    np.testing.assert_array_equal(np.abs(np.diff(cells[order], axis=0)).sum(axis=1), 1)


def test_the_far_edge_belongs_to_the_last_cell_and_equal_points_keep_their_order():
    np.testing.assert_array_equal(find_hilbert_order(np.array([[1.0, 1.0], [0.99, 0.99], [0.0, 0.0]]), 3)[:1], [2])
    np.testing.assert_array_equal(find_hilbert_order(np.full((5, 3), 0.4), 10), np.arange(5))
    assert len(find_hilbert_order(np.zeros((0, 6)), 10)) == 0
