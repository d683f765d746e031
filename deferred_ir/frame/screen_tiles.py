"""Tiled light culling: which VPLs may light which tiles of the screen. No OpenGL.

The surfaces in a tile lie in a frustum between its smallest and its largest depth. A VPL adds exactly nothing to a tile
whose frustum lies behind it, or outside the pyramid about its cone.
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
"""Edge of a tile in pixels, as of llvmpipe's own tiles. Smaller tiles skip a few more VPLs, but cost more
in draws than that saves."""

ALIGNED = 16
"""Lists of VPLs begin at multiples of this many records, 1280 bytes: uniform blocks must begin at multiples of 256."""
FEWEST = 8
"""Fewest VPLs for which culling by tile pays."""


@dataclass(frozen=True, eq=False)
class Tiles:
    """Tiles that show a surface.

    rectangles: int (t, 4), x, y, width and height in pixels. corners: float32 (8, t, 3), of their frustums, in world
    space. margin: float32 (t,), by which rounding may move their pixels.
    """

    rectangles: Ints
    corners: Array
    margin: Array

    @classmethod
    def build(cls, depth: Array, camera: Camera, near: float) -> Tiles:
        """Build tiles from reversed depths (H, W), bottom row first, 0 on the background. near: the near plane."""
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

    def find_lit(self, vpls: np.ndarray) -> Bools:
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
    """One draw: a tile, and the VPLs of the packed records that it adds up.

    start, count: where its list of VPLs begins, and how many they are. first: it is the tile's first draw.
    """

    rectangle: tuple[int, int, int, int]
    start: int
    count: int
    first: bool


def list_draws(tiles: Tiles, records: np.ndarray) -> tuple[np.ndarray, list[Draw]]:
    """Return lists of VPLs for the tiles, from VPL records (n,), as packed records (m,) and the draws that read them.

    A tile has a draw for each block of the buffer with VPLs that may light it, in their order, so that its sums stay
    the same; the first block always has one. Lists begin at multiples of 256 bytes and are followed by a whole block of
    records.
    """
    chosen = tiles.find_lit(records) & find_shining(records)
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
