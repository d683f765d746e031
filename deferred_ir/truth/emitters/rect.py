"""A rectangle of constant radiance that shines to one side."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from deferred_ir.base.arrays import Array, Bools
from deferred_ir.truth.emitters.flat import FlatTwin


@dataclass(frozen=True, eq=False)
class RectTwin(FlatTwin):
    """A rectangle."""

    @property
    def area(self) -> float:
        """Its area."""
        across, along = self.light.size
        return float(across * along)

    def place(self, points: Array) -> Array:
        """Stretch the unit square to it."""
        places: Array = (points - 0.5) * self.light.size
        return places

    def covers(self, places: Array) -> Bools:
        """Return which places lie on it."""
        across, along = self.light.size
        inside: Bools = (np.abs(places[:, 0]) <= across / 2) & (np.abs(places[:, 1]) <= along / 2)
        return inside


TWIN = RectTwin
