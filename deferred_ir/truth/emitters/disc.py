"""A disc of constant radiance that shines to one side."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from deferred_ir.base.arrays import Array, Bools
from deferred_ir.truth.emitters.flat import FlatTwin


@dataclass(frozen=True, eq=False)
class DiscTwin(FlatTwin):
    """A disc."""

    @property
    def area(self) -> float:
        """Its area."""
        return float(np.pi * self.light.radius**2)

    def place(self, points: Array) -> Array:
        """Map the unit square to it in polar coordinates."""
        radius, angle = self.light.radius * np.sqrt(points[:, 0]), 2 * np.pi * points[:, 1]
        return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)

    def covers(self, places: Array) -> Bools:
        """Return which places lie on it."""
        inside: Bools = (places**2).sum(axis=1) <= self.light.radius**2
        return inside


TWIN = DiscTwin
