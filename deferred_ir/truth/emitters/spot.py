"""glTF's spot: its intensity is constant within an inner cone and falls smoothly to 0 at an outer one, no cosine."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from deferred_ir.base.arrays import Array
from deferred_ir.truth.emitters.base import LUMINANCE, Arriving, Twin, aim, dot, find_axes

LEAST = 0.001
"""Least difference between the cosines of both cones, as KHR_lights_punctual says."""


@dataclass(frozen=True, eq=False)
class SpotTwin(Twin):
    """A spot."""

    @cached_property
    def _axis(self) -> Array:
        axis: Array = find_axes(np.subtract(self.light.look_at, self.light.position))[0]
        return axis

    @cached_property
    def emission(self) -> Array:
        """Its intensity along its axis."""
        return np.asarray(self.light.intensity, float)

    @property
    def power(self) -> float:
        """Its luminous flux if the whole cone were as bright as its middle."""
        cap = 2 * np.sin(np.radians(self.light.fov) / 4) ** 2
        return float(2 * np.pi * cap * (LUMINANCE @ self.emission))

    @property
    def spreads(self) -> bool:
        """It does not."""
        return False

    def sample(self, at: Array, points: Array) -> Arriving:
        """Return what arrives."""
        del points
        source = np.broadcast_to(np.asarray(self.light.position, float), at.shape)
        to, square = aim(source, at)
        # cos a - cos b = 2 (sin^2(b/2) - sin^2(a/2)), which does not cancel for narrow cones.
        outer, inner = (np.sin(np.radians(angle) / 4) ** 2 for angle in (self.light.fov, self.light.inner_fov))
        inside = 2 * outer - dot(to + self._axis, to + self._axis) / 2
        falloff = np.clip(inside / max(LEAST, 2 * (outer - inner)), 0, 1)
        return Arriving(to, source, falloff**2, square)


TWIN = SpotTwin
