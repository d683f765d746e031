"""A rough model of what direct shadows cost, by map or by rays; plans are made before any frame is measured."""

from __future__ import annotations


def estimate_direct_ray_cost(pixels: int, samples: int) -> float:
    """Return milliseconds for `samples` shadow rays to the spotlight from each pixel.

    Measured with two cores, and taken for any number: cores must not choose between ways that differ in pixels.
    """
    return 1e-4 * pixels * samples


def estimate_direct_map_cost(triangles: int, *, software: bool) -> float:
    """Return milliseconds for the spotlight's shadow map: most texels of it, and then triangles.

    Measured with OpenGL in software; a GPU takes a small fraction of it.
    """
    return (7.0 + 1.1e-3 * triangles) * (1 if software else 0.02)
