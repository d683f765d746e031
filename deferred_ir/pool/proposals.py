"""Lists of VPLs for the tiles of an image, from which the tile's pixels draw.

A tile's list is drawn from the pool with probabilities that are in part those of the VPLs' power and in part in
proportion to what each would bring to a few pixels of the tile unshadowed. Neighbours on a Hilbert curve through the
VPLs' positions and normals form groups, and only one of each group is scored; within a group VPLs are drawn by power.
A shader draws the lists (shaders/list_vpls/list.glsl). The sum over a list of what its VPLs bring, each times its
weight, is right in the mean for every pixel of the image, whatever the scores are, since EVEN is above 0.
"""

from __future__ import annotations

import numpy as np

from deferred_ir.base.arrays import Array, Ints
from deferred_ir.sampling.hilbert import find_hilbert_order

GROUPS = 1024
"""Most groups of a pool: a row of scores for each tile."""
EVEN = 0.3
"""Fraction of the probability that goes by power alone, whatever a tile's few probes see of a VPL."""
TILES = 16
"""Tiles along an edge of the image, whatever its size."""
BITS = 10
"""Bits a coordinate on the curve."""


def order_along_curve(position: Array, normal: Array) -> Ints:
    """Return indices that sort VPLs (n, 3), (n, 3) along a Hilbert curve through their positions and normals."""
    if not len(position):
        return np.zeros(0, int)
    low = position.min(axis=0)
    extent = max(float((position - low).max()), np.finfo(float).tiny)
    return find_hilbert_order(np.concatenate([(position - low) / extent, normal / 4 + 0.25], axis=1), BITS)


def count_groups(count: int) -> int:
    """Return the number of groups of a pool of `count` VPLs, nearly equal in number of VPLs; group g of n begins at
    g * count // n."""
    return min(GROUPS, count)


def share_power(power: Array) -> tuple[Array, Array]:
    """Share out the luminous `power` (n,), not negative, of a pool's VPLs among its g groups.

    Returns each group's share of the whole, float64 (g,), and for each VPL the part of its group's power that it has
    with those before it, float64 (n,); all 0 where there is no power.
    """
    starts = _find_starts(len(power))
    cumulative = np.concatenate([[0.0], np.cumsum(power, dtype=np.float64)])
    before = cumulative[starts[:-1]]
    own = cumulative[starts[1:]] - before
    sizes = np.diff(starts)
    whole = np.repeat(own, sizes)
    within = np.divide(cumulative[1:] - np.repeat(before, sizes), whole, out=np.zeros(len(power)), where=whole > 0)
    return own / max(cumulative[-1], np.finfo(float).tiny), within


def draw_members(within: Array, points: Array) -> Ints:
    """Draw a VPL of each group by power, int (g,). within: as from `share_power`. points: (g,) in [0, 1)."""
    starts = _find_starts(len(within))
    group = np.arange(len(points), dtype=float)
    marks = np.maximum(group + (1 - points), np.nextafter(group, np.inf))  # beyond VPLs without power
    found = np.searchsorted(np.repeat(group, np.diff(starts)) + within, marks)
    drawn: Ints = np.clip(found, starts[:-1], starts[1:] - 1)
    return drawn


def _find_starts(count: int) -> Ints:
    groups = count_groups(count)
    return np.arange(groups + 1) * count // max(groups, 1)


def add_up_chances(scores: Array, shares: Array) -> Array:
    """Return the chance of each group and all before it in each tile, float32 (t, g); 0 where the pool has no power.

    scores: float32 (t, g), what each group would bring to each tile, not negative, in any unit. shares: (g,), each
    group's share of the power. The differences between neighbours are the chances, exactly.
    """
    totals = scores.sum(axis=1, keepdims=True)
    lit = totals > np.finfo(np.float32).tiny
    chances = scores * np.divide(1 - EVEN, totals, out=np.zeros_like(totals), where=lit)
    chances += shares.astype(np.float32) * np.where(lit, np.float32(EVEN), np.float32(1))
    cumulative = np.cumsum(chances, axis=1, dtype=np.float64)
    cumulative /= np.maximum(cumulative[:, -1:], np.finfo(float).tiny)
    return cumulative.astype(np.float32)
