"""Automatic exposure on the CPU, as shaders/tonemap/exposure.vert finds it: to show a second image like the first."""

from __future__ import annotations

from typing import Any

import numpy as np

from deferred_ir.base.colour import LUMINANCE

GRID = 64
MIDDLE_GREY = 0.18


def automatic_stops(radiance: Any) -> float:
    """Stops that bring the mean luminance of what is lit in radiance (H, W, 3), top row first, to middle grey."""
    height, width = radiance.shape[:2]
    rows, columns = (_middles(length) for length in (height, width))
    luminance = radiance[::-1][np.ix_(rows, columns)].astype(np.float64) @ LUMINANCE
    lit = luminance[luminance > 0]
    return float(np.log2(MIDDLE_GREY / lit.mean())) if len(lit) else 0.0


def _middles(length: int) -> Any:
    """Places of at most GRID samples, spread evenly."""
    count = min(length, GRID)
    return (np.arange(count) * 2 + 1) * length // (2 * count)
