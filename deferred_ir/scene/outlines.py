"""Lines that show where something without surfaces is: segments of world space, float64 (n, 2, 3)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from deferred_ir.base.arrays import Array
from deferred_ir.sampling.warps import build_basis

SIZE = 0.1
"""Size of outlines of what has none of its own, in radii of the scene's bounds."""
CORNERS = 32
"""Sides of the polygon that stands for a circle."""
HEAD = 0.2
"""Length of an arrow's head over that of the arrow."""


def draw_polygon(corners: Array) -> Array:
    """Return the edges of a closed polygon; corners: (n, 3)."""
    return np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)


def draw_circle(middle: Sequence[float], axis: Array, radius: float) -> Array:
    """Return a circle at right angles to a unit axis."""
    right, up = build_basis(axis)
    angle = np.arange(CORNERS) * (2 * np.pi / CORNERS)
    ring = np.cos(angle)[:, None] * right + np.sin(angle)[:, None] * up
    return draw_polygon(np.asarray(middle, float) + radius * ring)


def draw_ball(middle: Sequence[float], radius: float) -> Array:
    """Return three circles of a ball."""
    return np.concatenate([draw_circle(middle, axis, radius) for axis in np.eye(3)])


def draw_cross(middle: Sequence[float], arm: float) -> Array:
    """Return lines through a point along the axes of the world."""
    ends: Array = np.asarray(middle, float) + arm * np.stack([np.eye(3), -np.eye(3)], axis=1)
    return ends


def draw_arrow(start: Sequence[float], axis: Array, length: float) -> Array:
    """Return an arrow from a point along a unit axis."""
    foot = np.asarray(start, float)
    tip = foot + length * axis
    right, _ = build_basis(axis)
    wings = tip - HEAD * length * (axis + np.array([[0.5], [-0.5]]) * right)
    return np.stack([np.stack([other, tip]) for other in (foot, *wings)])


def draw_cone(apex: Sequence[float], axis: Array, fov: float, length: float) -> Array:
    """Return four edges and the rim of a cone. fov: full opening angle, degrees; length: from the apex to the rim."""
    half = np.radians(fov) / 2
    start = np.asarray(apex, float)
    rim = draw_circle(start + length * np.cos(half) * axis, axis, length * float(np.sin(half)))
    edges = np.stack([np.broadcast_to(start, (4, 3)), rim[:: CORNERS // 4, 0]], axis=1)
    return np.concatenate([edges, rim])
