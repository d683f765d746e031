"""Automatic exposure on the CPU, as shaders/tonemap/exposure.vert computes it: shows a second image like the first."""

from __future__ import annotations

from typing import Any

import numpy as np

from deferred_ir.base.colour import LUMINANCE

GRID = 64
"""Samples along each side of the image."""
MIDDLE_GREY = 0.18


def compute_stops(radiance: Any) -> float:
    """Return the stops that bring the mean luminance of what is lit to middle grey; radiance: (H, W, 3), top row first.

    Looks at GRID x GRID pixels at most; 0 if none of them is lit.
    """
    height, width = radiance.shape[:2]
    rows, columns = (_spread(length) for length in (height, width))
    luminance = radiance[::-1][np.ix_(rows, columns)].astype(np.float64) @ LUMINANCE
    lit = luminance[luminance > 0]
    return float(np.log2(MIDDLE_GREY / lit.mean())) if len(lit) else 0.0


def _spread(length: int) -> Any:
    """Return the indices of at most GRID samples, spread evenly."""
    count = min(length, GRID)
    return (np.arange(count) * 2 + 1) * length // (2 * count)
