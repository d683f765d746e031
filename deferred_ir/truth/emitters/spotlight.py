"""The spotlight of docs/conventions.md, I(w) = E cos(theta) cone(theta), or a disc that shines so at each point."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from deferred_ir.base.arrays import Array
from deferred_ir.truth.emitters.base import LUMINANCE, Arriving, Twin, aim, dot, find_axes


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
        # 1 - cos of angle and cone by squares of half angles: differences would cancel for the narrowest cones.
        off_axis, edge = dot(to + axis, to + axis) / 2, 2 * np.sin(np.radians(light.fov) / 4) ** 2
        cone = np.clip(4 * (edge - off_axis) / edge, 0, 1)
        return Arriving(to, source, np.maximum(-(to @ axis), 0) * cone, square)


TWIN = SpotlightTwin
