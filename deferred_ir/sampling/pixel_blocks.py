"""Stratified points of the unit square dealt to the pixels of a block, for images that will be filtered.

The pixels of a block take different cells of one stratification, so that the mean over any window of a block's size is
that of a well-spread set.
"""

from __future__ import annotations

from functools import lru_cache
from math import gcd

import numpy as np

from deferred_ir.base.arrays import Array, Ints


def deal(pixel: Ints, width: int, samples: float, block: int, turn: int) -> tuple[Ints, Ints, int]:
    """Deal the cells of a stratification to `pixel` (n,), indices into an image of this width.

    Returns which rows of `pixel` trace rays, (m,), the cell of each of their rays, (m, rays a pixel), and the number of
    cells of a block. turn: below block^2, chooses one of the ways to deal.
    """
    cells = block * block
    y, x = np.divmod(pixel, width)
    rank = _ranks(block)[y % block, x % block] ^ turn
    if samples < 1:
        few = max(round(cells * samples), 1)
        traced = np.flatnonzero(rank < few)
        return traced, rank[traced, None], few
    each = round(samples)
    return np.arange(len(pixel)), rank[:, None] + cells * np.arange(each), cells * each


@lru_cache
def _ranks(block: int) -> Ints:
    """Return Bayer's ordered dither: the numbers below block^2, with the first few of them spread evenly."""
    ranks = np.zeros((1, 1), int)
    while len(ranks) < block:
        ranks = np.block([[4 * ranks, 4 * ranks + 2], [4 * ranks + 3, 4 * ranks + 1]])
    return ranks


@lru_cache
def find_lattice(count: int) -> tuple[int, int, Array]:
    """Find the best rank-1 lattice of `count` points (i, g i mod count) / count: g makes its longer step shortest.

    Returns count, g, and the two shortest steps (2, 2).
    """
    best: tuple[float, int, Array] | None = None
    for g in range(1, count + 1):
        if gcd(g, count) == 1:
            steps = _reduce(np.array([1, g]), np.array([0, count]))
            longer = float((steps[1] ** 2).sum())
            if best is None or longer < best[0]:
                best = longer, g, steps / count
    assert best  # 1 is coprime to every count
    return count, best[1], best[2].astype(np.float32)


def _reduce(a: Ints, b: Ints) -> Ints:
    """Return the two shortest steps of the lattice of integers a and b, the shorter first (Gauss's reduction)."""
    while True:
        if a @ a > b @ b:
            a, b = b, a
        times = round(float(a @ b) / float(a @ a))
        if times == 0:
            return np.stack([a, b])
        b = b - times * a


def jitter(index: Ints, grid: tuple[int, int, Array], rng: np.random.Generator) -> Array:
    """Return a random point in the cell of each lattice point, float32 (n, 2); cells are equal parallelograms."""
    count, g, steps = grid
    jitter = rng.random((len(index), 2), np.float32) @ steps
    corner = np.stack([index, index * g % count], axis=1).astype(np.float32) / np.float32(count)
    points: Array = (corner + jitter) % 1
    return points
