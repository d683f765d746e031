"""A point that shines all around, or a ball of the same intensity: of radiance I / (pi r^2)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from deferred_ir.base.arrays import Array
from deferred_ir.rays.tracer import Hits
from deferred_ir.truth.emitters.base import LUMINANCE, Arriving, Twin, aim
from deferred_ir.truth.emitters.sphere import meet_ball, sample_ball


@dataclass(frozen=True, eq=False)
class PointTwin(Twin):
    """A point."""

    @cached_property
    def emission(self) -> Array:
        """Its intensity."""
        return np.asarray(self.light.intensity, float)

    @property
    def power(self) -> float:
        """Its luminous flux."""
        return float(4 * np.pi * (LUMINANCE @ self.emission))

    @property
    def spreads(self) -> bool:
        """Whether it is a ball."""
        return bool(self.light.radius > 0)

    def sample(self, at: Array, points: Array) -> Arriving:
        """Return what arrives."""
        centre, radius = np.asarray(self.light.position, float), self.light.radius
        if radius == 0:
            source = np.broadcast_to(centre, at.shape)
            to, square = aim(source, at)
            return Arriving(to, source, np.ones(len(at)), square)
        found = sample_ball(centre, radius, at, points)
        return Arriving(found.to, found.ends, found.strength / (np.pi * radius**2), found.over)

    def meet(self, origins: Array, directions: Array, found: Hits) -> tuple[Array, Array]:
        """Return the radiance over intensity of rays that enter the ball ahead of the surface that they hit."""
        centre, radius = np.asarray(self.light.position, float), self.light.radius
        shining, density = meet_ball(centre, radius, origins, directions, found)
        return shining / (np.pi * radius**2), density


TWIN = PointTwin
