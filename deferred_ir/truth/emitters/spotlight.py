"""The spotlight of docs/conventions.md, I(w) = E cos(theta) cone(theta), or a disc that shines so at each point."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from deferred_ir.base.arrays import Array
from deferred_ir.rays.tracer import Hits
from deferred_ir.truth.emitters.base import LUMINANCE, Arriving, Twin, aim, dot, find_axes

LEAST = 1e-12
"""Keeps divisors off 0 where the disc is seen edge-on."""


@dataclass(frozen=True, eq=False)
class SpotlightTwin(Twin):
    """A spotlight."""

    @cached_property
    def _axes(self) -> Array:
        """Its axis and two directions that span its disc."""
        return find_axes(np.subtract(self.light.look_at, self.light.position))

    @cached_property
    def emission(self) -> Array:
        """Its E."""
        return np.asarray(self.light.emission, float)

    @property
    def power(self) -> float:
        """Its luminous flux without the soft edge of the cone."""
        return float(np.pi * np.sin(np.radians(self.light.fov) / 2) ** 2 * (LUMINANCE @ self.emission))

    @property
    def spreads(self) -> bool:
        """Whether it is a disc."""
        return bool(self.light.radius > 0)

    def sample(self, at: Array, points: Array) -> Arriving:
        """Return what arrives from points of its disc."""
        light = self.light
        axis, right, up = self._axes
        angle, radius = 2 * np.pi * points[:, 1:], light.radius * np.sqrt(points[:, :1])
        source = np.asarray(light.position) + radius * (np.cos(angle) * right + np.sin(angle) * up)
        to, square = aim(source, at)
        leaving = np.maximum(-(to @ axis), 0)
        arriving = leaving * self._find_cone(to)
        if not self.spreads:
            return Arriving(to, source, arriving, square)
        return Arriving(to, source, arriving, square, square / (self._area * np.maximum(leaving, LEAST)))

    def meet(self, origins: Array, directions: Array, found: Hits) -> tuple[Array, Array]:
        """Return the radiance over E of rays that cross its disc ahead of the surface that they hit."""
        axis, right, up = self._axes
        leaving = -(directions @ axis)
        off = origins - np.asarray(self.light.position, float)
        reach = (off @ axis) / np.where(leaving > 0, leaving, 1)
        place = off + reach[:, None] * directions
        across, way = place @ np.stack([right, up], axis=1), found.position - origins
        free = ~found.hit | (reach**2 < dot(way, way))
        met = (leaving > 0) & (reach > 0) & free & (dot(across, across) <= self.light.radius**2)
        radiance = met * self._find_cone(directions) / self._area
        return radiance, reach**2 / (self._area * np.maximum(leaving, LEAST))

    @property
    def _area(self) -> float:
        return float(np.pi * self.light.radius**2)

    def _find_cone(self, to: Array) -> Array:
        """Return the fraction that the cone lets through against unit `to` (n, 3), (n,)."""
        # 1 - cos of angle and cone by squares of half angles: differences would cancel for the narrowest cones.
        off = to + self._axes[0]
        off_axis, edge = dot(off, off) / 2, 2 * np.sin(np.radians(self.light.fov) / 4) ** 2
        cone: Array = np.clip(4 * (edge - off_axis) / edge, 0, 1)
        return cone


TWIN = SpotlightTwin
