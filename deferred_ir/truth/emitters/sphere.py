"""A sphere of constant radiance that shines outwards: nothing arrives inside it, and it hides nothing."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from deferred_ir.base.arrays import Array, Bools
from deferred_ir.rays.tracer import Hits
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

    def meet(self, origins: Array, directions: Array, found: Hits) -> tuple[Array, Array]:
        """Return the radiance of rays that enter it ahead of the surface that they hit."""
        return meet_ball(np.asarray(self.light.position, float), self.light.radius, origins, directions, found)


def sample_ball(centre: Array, radius: float, at: Array, points: Array) -> Arriving:
    """Return what arrives at points `at` (n, 3) from a ball of radiance 1, directions uniform in solid angle."""
    axis, square = aim(np.broadcast_to(centre, at.shape), at)
    outside, height = _find_cap(radius, square)
    to = sample_cap(points, axis, height)
    near = _enter(centre, radius, at, to)[0]
    return Arriving(to, at + near[:, None] * to, outside * 1.0, 1 / (2 * np.pi * height))


def meet_ball(centre: Array, radius: float, origins: Array, directions: Array, found: Hits) -> tuple[Array, Array]:
    """Return the radiance, of 1, that rays (n, 3), unit (n, 3), find in a ball, and the density of `sample_ball`."""
    way = centre - origins
    outside, height = _find_cap(radius, dot(way, way))
    near, inside = _enter(centre, radius, origins, directions)
    there = found.position - origins
    free = ~found.hit | (near**2 < dot(there, there))
    return (outside & inside & (near > 0) & free) * 1.0, 1 / (2 * np.pi * height)


def _find_cap(radius: float, square: Array) -> tuple[Bools, Array]:
    """Return whether points at squared distances `square` (n,) lie outside, and 1 - cos of half the angle they see."""
    outside = square > radius**2
    sine_squared = np.where(outside, radius**2 / np.maximum(square, radius**2), 0.5)
    # 1 - cos = 2 sin^2 of the half angle does not cancel for small balls.
    return outside, 2 * np.sin(np.arcsin(np.sqrt(sine_squared)) / 2) ** 2


def _enter(centre: Array, radius: float, at: Array, to: Array) -> tuple[Array, Bools]:
    """Return how far along unit `to` (n, 3) rays enter the ball, or pass nearest to its middle, and which enter it."""
    # The nearer root of |t to - way| = radius, from the way to the middle.
    way = centre - at
    along = dot(to, way)
    off = way - along[:, None] * to
    left = radius**2 - dot(off, off)
    return along - np.sqrt(np.maximum(left, 0)), left > 0


TWIN = SphereTwin
