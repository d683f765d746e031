"""Light from one direction, or from a disc of the sky of constant radiance."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from deferred_ir.base.arrays import Array
from deferred_ir.rays.tracer import Hits
from deferred_ir.truth.emitters.base import LUMINANCE, Arriving, Twin, dot, find_axes, sample_cap


@dataclass(frozen=True, eq=False)
class DirectionalTwin(Twin):
    """A directional light."""

    @cached_property
    def _towards(self) -> Array:
        """Unit direction towards its middle, (3,)."""
        towards: Array = find_axes(np.subtract(self.light.position, self.light.look_at))[0]
        return towards

    @cached_property
    def emission(self) -> Array:
        """Its irradiance on planes that face its middle."""
        return np.asarray(self.light.irradiance, float)

    @property
    def power(self) -> float:
        """The luminous flux through the disc about the scene."""
        return float(np.pi * self.around.radius**2 * (LUMINANCE @ self.emission))

    @property
    def spreads(self) -> bool:
        """Whether it is a disc."""
        return bool(self.light.angle > 0)

    def sample(self, at: Array, points: Array) -> Arriving:
        """Return what arrives."""
        to = np.broadcast_to(self._towards, at.shape)
        if not self.spreads:
            return Arriving(to, self.around.leave(at, to), np.ones(len(at)), np.ones(len(at)))
        height, radiance, density = self._find_disc()
        to = sample_cap(points, to, height)
        return Arriving(to, self.around.leave(at, to), np.full(len(at), radiance), np.full(len(at), density))

    def meet(self, origins: Array, directions: Array, found: Hits) -> tuple[Array, Array]:
        """Return the radiance over irradiance of rays that hit nothing."""
        height, radiance, density = self._find_disc()
        off = directions - self._towards
        met = ~found.hit & (dot(off, off) / 2 <= height)
        return met * radiance, np.full(len(origins), density)

    def _find_disc(self) -> tuple[float, float, float]:
        """Return 1 - cos of half its angle, its radiance over its irradiance, and 1 over its solid angle."""
        half = np.radians(self.light.angle) / 2
        height = 2 * np.sin(half / 2) ** 2
        # The integral of the cosine over the disc is pi sin^2 of its half angle.
        return height, 1 / (np.pi * np.sin(half) ** 2), 1 / (2 * np.pi * height)


TWIN = DirectionalTwin
