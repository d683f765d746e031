"""Sorts points along a Hilbert curve (Skilling 2004, "Programming the Hilbert curve").

Neighbours on the curve are neighbours in space, so an even spread along it is an even spread in space.
"""

from __future__ import annotations

import numpy as np

from deferred_ir.base.arrays import Array, Ints


def find_hilbert_order(points: Array, bits: int) -> Ints:
    """Return indices that sort `points` (n, d) of [0, 1]^d along a curve of 2^(bits d) cells; bits d is at most 64."""
    cells = np.ascontiguousarray(np.clip(points * 2.0**bits, 0, 2**bits - 1).astype(np.uint64).T)
    zero, one = np.uint64(0), np.uint64(1)
    levels = one << np.arange(bits - 1, 0, -1, dtype=np.uint64)
    # From coarse cells to fine: rotate and mirror the curve within each by the orientation of the cell around it.
    for level in levels:
        below = level - one
        for i in range(len(cells)):
            upper = (cells[i] & level) != 0
            swapped = np.where(upper, zero, (cells[0] ^ cells[i]) & below)
            cells[0] ^= np.where(upper, below, swapped)
            cells[i] ^= swapped
    cells = np.bitwise_xor.accumulate(cells, axis=0)  # Gray code
    last = cells[-1].copy()
    for level in levels:
        cells ^= np.where(last & level, level - one, zero)
    key = np.zeros(len(points), np.uint64)
    for bit in range(bits - 1, -1, -1):
        for coordinate in cells:
            key = (key << one) | (coordinate >> np.uint64(bit) & one)
    order: Ints = np.argsort(key, kind="stable")
    return order
