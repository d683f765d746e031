"""Colour: the weights of luminance and the decoding of sRGB."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from deferred_ir.base.arrays import Array

LUMINANCE: Array = np.array([0.2126, 0.7152, 0.0722])
"""Weights of linear red, green and blue (sRGB primaries, Rec. 709) in luminance."""


def linear_from_srgb(values: Array) -> Array:
    """Decode sRGB values in [0, 1] to linear ones, float64 (IEC 61966-2-1)."""
    clipped = np.clip(np.asarray(values, dtype=np.float64), 0, 1)
    linear: Array = np.where(clipped <= 0.04045, clipped / 12.92, ((clipped + 0.055) / 1.055) ** 2.4)
    return linear


@lru_cache(maxsize=1)
def srgb_table() -> Array:
    """Return the linear values of the 256 levels of 8-bit sRGB, float32 (256,), read-only."""
    table = linear_from_srgb(np.arange(256) / 255).astype(np.float32)
    table.flags.writeable = False
    return table
