"""Lists of VPLs for the tiles of an image, from which the tile's pixels draw.

A tile's list is drawn from the pool with probabilities that are in part those of the VPLs' power and in part in
proportion to what each would bring to a few pixels of the tile unshadowed. Neighbours on a Hilbert curve through the
VPLs' positions and normals form groups, and only one of each group is scored; within a group VPLs are drawn by power.
Lists are drawn systematically along the curve, so they keep the pool's stratification. The sum over a list of what its
VPLs bring, each times its weight, is right in the mean for every pixel of the image, whatever the scores are, since
EVEN is above 0.
"""

from __future__ import annotations

from contextlib import closing
from dataclasses import dataclass

import numpy as np

from deferred_ir.base.arrays import Array, Ints
from deferred_ir.base.parallel import run_in_order
from deferred_ir.sampling.hilbert import find_hilbert_order

GROUPS = 1024
"""Most groups of a pool: a row of scores for each tile."""
EVEN = 0.3
"""Fraction of the probability that goes by power alone, whatever a tile's few probes see of a VPL."""
TEXELS = 4
"""Texels of a VPL in a list: position, power times weight; normal, clamp^2; emission, weight; one that aligns them."""
TILES = 16
"""Tiles of a task: few enough for their arrays to stay in a core's cache."""
BITS = 10
"""Bits a coordinate on the curve."""


def order_along_curve(position: Array, normal: Array) -> Ints:
    """Return indices that sort VPLs (n, 3), (n, 3) along a Hilbert curve through their positions and normals."""
    if not len(position):
        return np.zeros(0, int)
    low = position.min(axis=0)
    extent = max(float((position - low).max()), np.finfo(float).tiny)
    return find_hilbert_order(np.concatenate([(position - low) / extent, normal / 4 + 0.25], axis=1), BITS)


@dataclass(frozen=True, eq=False)
class Groups:
    """Groups of a pool of n VPLs in the order of the curve: group g holds the VPLs starts[g] to starts[g + 1].

    starts: int (g + 1,). cumulative: the power of all VPLs before each, float64 (n + 1,).
    """

    starts: Ints
    cumulative: Array

    @classmethod
    def of_power(cls, power: Array) -> Groups:
        """Part VPLs of luminous `power` (n,), not negative, into up to GROUPS groups of nearly equal numbers."""
        count = min(GROUPS, len(power))
        starts = np.arange(count + 1) * len(power) // max(count, 1)
        return cls(starts, np.concatenate([[0.0], np.cumsum(power, dtype=np.float64)]))

    @property
    def power(self) -> Array:
        """The power of each group, float64 (g,)."""
        return np.diff(self.cumulative[self.starts])

    def draw_members(self, groups: Ints, points: Array) -> tuple[Ints, Array]:
        """Draw a VPL of each of `groups` (m,) by power; points: (m,) in [0, 1).

        Returns the VPLs, int (m,), and the probability of each within its group.
        """
        first, last = self.starts[groups], self.starts[groups + 1]
        low, power = self.cumulative[first], self.power[groups]
        found = np.searchsorted(self.cumulative, low + points * power, side="right") - 1
        found = np.clip(found, first, last - 1)
        own = self.cumulative[found + 1] - self.cumulative[found]
        return found, np.divide(own, power, out=np.zeros(len(found)), where=power > 0)


def draw_lists(scores: Array, groups: Groups, entries: int, rng: np.random.Generator) -> tuple[Ints, Array]:
    """Draw a list of `entries` VPLs for each tile. Returns the VPLs, int (t, entries), and their weights, float64.

    scores: float32 (t, g), what each group would bring to each tile, not negative, in any unit. A weight is 1 over the
    number of times that a list should hold the VPL; 0 stands for no VPL, where the pool has no power.
    """
    tiles, power = len(scores), groups.power
    found, weight = np.zeros((tiles, entries), int), np.zeros((tiles, entries))
    if not power.sum() > 0:
        return found, weight
    even = (power / power.sum()).astype(np.float32)
    starts, points = rng.random((tiles, 1)), rng.random((tiles, entries))

    def work(rows: slice) -> tuple[Ints, Array]:
        chances = _mix(scores[rows], even)
        drawn, chance = _draw_systematically(chances, entries, starts[rows])
        member, within = groups.draw_members(drawn, points[rows].reshape(-1))
        chance *= within
        one = np.divide(1 / entries, chance, out=np.zeros(len(drawn)), where=chance > 0)
        return member.reshape(-1, entries), one.reshape(-1, entries)

    tasks = [slice(start, start + TILES) for start in range(0, tiles, TILES)]
    with closing(run_in_order(work, tasks)) as results:
        for rows, (members, weights) in zip(tasks, results, strict=True):
            found[rows], weight[rows] = members, weights
    return found, weight


def _mix(scores: Array, even: Array) -> Array:
    """Return the probabilities of groups in tiles, float32 (t, g): in part `even` (g,), in part by `scores` (t, g)."""
    totals = scores.sum(axis=1, keepdims=True)
    lit = totals > np.finfo(np.float32).tiny
    chances: Array = scores * np.divide(1 - EVEN, totals, out=np.zeros_like(totals), where=lit)
    chances += even * np.where(lit, np.float32(EVEN), np.float32(1))
    return chances


def _draw_systematically(chances: Array, entries: int, starts: Array) -> tuple[Ints, Array]:
    """Draw `entries` groups for each tile in the order of groups; starts: (t, 1) in [0, 1).

    Returns the groups, int (t * entries,), and the probability of each in its tile, float64.
    """
    tiles, count = chances.shape
    marks = np.cumsum(chances, axis=1, dtype=np.float64)
    totals = marks[:, -1:].copy()
    marks *= entries / totals
    marks += starts
    reached = np.minimum(marks, entries).astype(np.int32)
    reached[:, -1] = entries
    counts = np.diff(reached, axis=1, prepend=np.int32(0)).reshape(-1)
    drawn = np.repeat(np.arange(tiles * count), counts)
    return drawn % count, chances.reshape(-1)[drawn] / np.repeat(totals[:, 0], entries)
