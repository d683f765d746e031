"""A rough model of what a VPL's shadows cost, by map or by rays; plans are made before any frame is measured."""

from __future__ import annotations

import os

EXTRA = 0.1
"""Fraction of all VPLs that an average pixel asks beyond its share, for neighbours that are missing beside edges."""


def estimate_ray_cost(pixels: int, shares: int) -> float:
    """Return milliseconds a VPL for shadow rays from an image's pixels, each of which asks 1/shares of the VPLs.

    Measured: 0.1 us of a core for each pixel and VPL in a room, 0.17 us in a cathedral.
    """
    return pixels * (1 / shares + EXTRA) * 1.5e-4 / (os.cpu_count() or 1)


def estimate_map_cost(triangles: int, *, software: bool) -> float:
    """Return milliseconds a VPL for a shadow map of so many triangles.

    Measured with OpenGL in software; a GPU takes a small fraction of it.
    """
    return (0.15 + 1.1e-4 * triangles) * (1 if software else 0.02)
