"""A sphere of constant radiance that shines outwards: nothing arrives inside it, and it hides nothing."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from deferred_ir.base.arrays import Array
from deferred_ir.truth.emitters.base import LUMINANCE, Arriving, Twin, aim, dot, sample_cap


@dataclass(frozen=True, eq=False)
class SphereTwin(Twin):
    """A sphere."""

    @cached_property
    def emission(self) -> Array:
        """Its radiance."""
        return np.asarray(self.light.radiance, float)

    @property
    def power(self) -> float:
        """Its luminous flux."""
        return float((2 * np.pi * self.light.radius) ** 2 * (LUMINANCE @ self.emission))

    @property
    def spreads(self) -> bool:
        """It does."""
        return True

    def sample(self, at: Array, points: Array) -> Arriving:
        """Return what arrives."""
        return sample_ball(np.asarray(self.light.position, float), self.light.radius, at, points)


def sample_ball(centre: Array, radius: float, at: Array, points: Array) -> Arriving:
    """Return what arrives at points `at` (n, 3) from a ball of radiance 1, directions uniform in solid angle."""
    axis, square = aim(np.broadcast_to(centre, at.shape), at)
    outside = square > radius**2
    sine_squared = np.where(outside, radius**2 / np.maximum(square, radius**2), 0.5)
    # 1 - cos = 2 sin^2 of the half angle does not cancel for small balls.
    height = 2 * np.sin(np.arcsin(np.sqrt(sine_squared)) / 2) ** 2
    to = sample_cap(points, axis, height)
    # Where the ray enters: the nearer root of |t to - way| = radius, from the way to the middle.
    way = centre - at
    along = dot(to, way)
    off = way - along[:, None] * to
    near = along - np.sqrt(np.maximum(radius**2 - dot(off, off), 0))
    return Arriving(to, at + near[:, None] * to, outside * 1.0, 1 / (2 * np.pi * height))


TWIN = SphereTwin
