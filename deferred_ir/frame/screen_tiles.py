"""Which VPLs may light which tiles of the screen, by the depths that a tile shows. No OpenGL.

What a tile's pixels show lies in a frustum: the tile's pyramid between its smallest and its largest depth. A VPL that
has this frustum behind it, or outside the pyramid about its cone, adds exactly nothing to any of them.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from deferred_ir.base.arrays import Array, Bools, Ints
from deferred_ir.frame.light_culling import MARGIN, find_shining
from deferred_ir.frame.vpl_buffer import VPLS_PER_BLOCK
from deferred_ir.scene.camera import Camera

EDGE = 64
"""Of a tile, pixels: a software driver's own. Smaller ones skip a few more VPLs, and cost more draws than that wins."""

ALIGNED = 16
"""Lists of lights begin at multiples of so many records: 1280 bytes, since uniform blocks begin at multiples of 256."""
FEWEST = 8
"""Fewest VPLs for which culling by tile pays."""


@dataclass(frozen=True, eq=False)
class Tiles:
    """Tiles that show a surface. rectangles: int (t, 4), x, y, width and height; corners: float32 (8, t, 3), world."""

    rectangles: Ints
    corners: Array
    margin: Array

    @classmethod
    def of(cls, depth: Array, camera: Camera, near: float) -> Tiles:
        """From reversed depths (H, W), bottom row first, 0 where there is no surface. near: the near plane."""
        height, width = depth.shape
        columns, rows = (np.arange(0, length, EDGE) for length in (width, height))
        farthest = np.where(depth > 0, depth, np.inf)
        low = np.minimum.reduceat(np.minimum.reduceat(farthest, rows), columns, axis=1)
        high = np.maximum.reduceat(np.maximum.reduceat(depth, rows), columns, axis=1)
        y, x = np.nonzero(high > 0)
        left, bottom = columns[x], rows[y]
        right, top = np.minimum(left + EDGE, width), np.minimum(bottom + EDGE, height)
        a, b, c = camera.ray_axes((width, height))
        sides = [side / width * 2 - 1 for side in (left, right)], [side / height * 2 - 1 for side in (bottom, top)]
        ends = near / high[y, x], near / low[y, x]
        offsets = np.stack(
            [
                (np.multiply.outer(u, a) + np.multiply.outer(v, b) + c) * z[:, None].astype(float)
                for u, v, z in itertools.product(*sides, ends)
            ]
        )
        rectangles = np.column_stack([left, bottom, right - left, top - bottom])
        reach = np.abs(offsets).max(axis=(0, 2)) + np.abs(camera.position).max()
        return cls(rectangles, (offsets + camera.position).astype(np.float32), (MARGIN * reach).astype(np.float32))

    def lit(self, vpls: np.ndarray) -> Bools:
        """Return which tiles each of the VPLs may light, bool (t, n). vpls: VPL (n,)."""
        x, y, z = (vpls[axis] for axis in ("x_axis", "y_axis", "z_axis"))
        position = vpls["position"]
        slack = self.margin[:, None] + np.float32(MARGIN) * np.abs(position).max(axis=1)
        lit = np.ones((len(self.rectangles), len(vpls)), bool)
        for normal in (z, z + x, z - x, z + y, z - y):
            front = (self.corners @ normal.T).max(axis=0) - (normal * position).sum(axis=1)
            lit &= front > -slack * np.linalg.norm(normal, axis=1)
        return lit


@dataclass(frozen=True)
class Draw:
    """One draw: a tile, and the VPLs that it adds up in the packed records.

    start, count: where its list of VPLs begins, and how many they are. first: it is the tile's first draw.
    """

    rectangle: tuple[int, int, int, int]
    start: int
    count: int
    first: bool


def list_draws(tiles: Tiles, records: np.ndarray) -> tuple[np.ndarray, list[Draw]]:
    """Return lists of VPLs for the tiles, from VPL records (n,), as packed records (m,) and the draws that read them.

    A tile has a draw for each block of the buffer in which a VPL may light it, with these VPLs in their order, so that
    its sums are the same; the first block's it has in any case. Lists begin at multiples of 256 bytes, and have a whole
    block of records behind them.
    """
    chosen = tiles.lit(records) & find_shining(records)
    rows, draws, end = [], list[Draw](), 0
    for start in range(0, max(len(records), 1), VPLS_PER_BLOCK):
        block = chosen[:, start : start + VPLS_PER_BLOCK]
        for rectangle, lit in zip(tiles.rectangles.tolist(), block, strict=True):
            listed = np.flatnonzero(lit) + start
            if start == 0 or len(listed):
                draws.append(Draw(tuple(rectangle), end, len(listed), start == 0))
                rows += [listed, np.zeros(-len(listed) % ALIGNED, int)]
                end += len(listed) + len(rows[-1])
    rows.append(np.zeros(VPLS_PER_BLOCK, int))
    return records[np.concatenate(rows)], draws
