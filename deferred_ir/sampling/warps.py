"""Maps of sample points: unit square to disc, disc to hemisphere, and an orthonormal basis about an axis."""

from __future__ import annotations

import numpy as np

from deferred_ir.base.arrays import Array


def square_to_disc(square: Array) -> Array:
    """Map points of the unit square (n, 2) to the unit disc, preserving area and strata (Shirley and Chiu 1997)."""
    a, b = 2 * square[:, 0] - 1, 2 * square[:, 1] - 1
    wide = np.abs(a) > np.abs(b)
    radius = np.where(wide, a, b)
    # The smaller over the larger coordinate; both are 0 only at the centre, where the angle does not matter.
    ratio = np.where(wide, b, a) / np.where(radius == 0, 1, radius)
    angle = np.where(wide, np.pi / 4 * ratio, np.pi / 2 - np.pi / 4 * ratio)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)


def lift_to_hemisphere(points: Array, axes: Array) -> Array:
    """Lift points of the unit disc (n, 2) to unit directions on the hemisphere about `axes` (n, 3) or (1, 3)."""
    right, up = build_basis(axes)
    height = np.sqrt(np.maximum(1 - (points**2).sum(axis=1, keepdims=True), 0))
    directions: Array = points[:, :1] * right + points[:, 1:] * up + height * axes
    return directions


def build_basis(axes: Array) -> tuple[Array, Array]:
    """Return right and up of right-handed orthonormal bases about unit `axes` (..., 3) (Duff et al. 2017)."""
    axes = np.asarray(axes, dtype=np.float64)
    x, y, z = axes[..., 0], axes[..., 1], axes[..., 2]
    sign = np.where(z < 0, -1.0, 1.0)
    a = -1.0 / (sign + z)
    b = x * y * a
    right, up = np.empty_like(axes), np.empty_like(axes)
    right[..., 0], right[..., 1], right[..., 2] = 1 + sign * x * x * a, sign * b, -sign * x
    up[..., 0], up[..., 1], up[..., 2] = b, sign + y * y * a, -y
    return right, up


def disc_to_square(disc: Array) -> Array:
    """Map points of the unit disc (n, 2) back to the unit square: the inverse of `square_to_disc`."""
    x, y = disc[:, 0], disc[:, 1]
    wide = np.abs(x) > np.abs(y)
    radius = np.copysign(np.hypot(x, y), np.where(wide, x, y))
    # The angle from the larger coordinate's axis, between -pi/4 and pi/4.
    ratio = np.arctan2(np.where(wide, y, x) * np.sign(radius), np.abs(np.where(wide, x, y))) * (4 / np.pi)
    a, b = np.where(wide, radius, radius * ratio), np.where(wide, radius * ratio, radius)
    square: Array = np.clip(np.stack([a, b], axis=1) / 2 + 0.5, 0, 1)
    return square


def square_to_sphere(square: Array) -> Array:
    """Map points of the unit square (n, 2) to the unit sphere (n, 3), preserving area and strata."""
    return disc_to_sphere(square_to_disc(square))


def disc_to_sphere(disc: Array) -> Array:
    """Map points of the unit disc (n, 2) to the unit sphere (n, 3), preserving area (Lambert 1772)."""
    return disc_to_cone(disc, np.array([0.0, 0.0, 1.0]), 2.0)


def disc_to_cone(disc: Array, axis: Array, edge: float) -> Array:
    """Map points of the unit disc (n, 2) to unit directions (n, 3) in a cone about unit `axis` (3,), preserving area.

    edge: 1 - cos of the cone's half angle; 2 is the whole sphere.
    """
    square = (disc**2).sum(axis=1)
    height = edge * square  # 1 - cos
    part = disc * np.sqrt(np.maximum(edge * (2 - height), 0))[:, None]
    right, up = build_basis(axis)
    directions: Array = part[:, :1] * right + part[:, 1:] * up + (1 - height)[:, None] * axis
    return directions
