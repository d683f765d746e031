"""Which glossy pixels trace rays, and for which of them samples stand."""

from __future__ import annotations

import numpy as np

from deferred_ir.base.arrays import Array, Bools, Ints
from deferred_ir.pool.layout import LONELY, Layout

WIDE, ALIKE = 0.1, 0.1
"""Of lobes wider than this, roughness 0.32, a sample's reflections stand for pixels around it whose roughness differs
by no more than the second."""


def choose_traced(layout: Layout, blend: Ints, roughness: Array) -> Bools:
    """Return which glossy pixels trace rays, bool (H * W,): for others samples of the layout stand, which do.

    blend: what each pixel takes of which samples, uint32 (H * W,), see lib/pool/blend.glsl. roughness: of each pixel,
    float32 (H * W,), below 0 where it is not glossy.
    """
    (width, height), scale = layout.size, layout.scale
    glossy = roughness >= 0
    wide: Bools = glossy & (roughness**2 > WIDE)
    grid = np.zeros(width * height, bool)
    pixels = layout.find_grid_pixels()
    grid[pixels] = True
    traced: Bools = glossy & ~(wide & ~grid & ((blend & LONELY) == 0))
    rest = np.flatnonzero(glossy & ~traced)
    y, x = np.divmod(rest, width)
    column, row = ((at - offset + scale) // scale - 1 for at, offset in zip((x, y), layout.offset, strict=True))
    served = np.zeros(len(rest), bool)
    for corner in range(4):
        across = np.clip(column + (corner & 1), 0, pixels.shape[1] - 1)
        up = np.clip(row + (corner >> 1), 0, pixels.shape[0] - 1)
        sample = pixels[up, across]
        share = blend[rest] >> (7 * corner) & 127
        served |= (share > 0) & wide[sample] & (np.abs(roughness[sample] - roughness[rest]) <= np.float32(ALIKE))
    traced[rest[~served]] = True
    return traced
