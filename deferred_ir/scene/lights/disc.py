"""A disc of constant radiance that shines to one side."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from deferred_ir.base.arrays import Array, Bools, Vec3
from deferred_ir.sampling.warps import build_basis
from deferred_ir.scene.lights.base import Bounds
from deferred_ir.scene.lights.fields import Fault
from deferred_ir.scene.lights.flat import FlatLight
from deferred_ir.scene.motion import LightMotion
from deferred_ir.scene.outlines import SIZE, draw_arrow, draw_circle


@dataclass(frozen=True)
class Disc(FlatLight):
    """position: of its middle; shines towards look_at; radius: scene units; radiance: W/(m^2 sr), linear RGB."""

    kind: ClassVar[str] = "disc"
    position: Vec3
    look_at: Vec3
    radius: float
    radiance: Vec3 = (1.0, 1.0, 1.0)
    motion: LightMotion | None = None

    def find_faults(self) -> Iterator[Fault]:
        """Yield what is wrong with the values."""
        yield from super().find_faults()
        yield from self.find_number_faults("radius", 0, open_ends=True)

    @property
    def area(self) -> float:
        """Its area, square scene units."""
        return math.pi * self.radius**2

    def locate(self, places: Array) -> Array:
        """Return points on it, (n, 3), for `places` (n, 2) of the unit disc."""
        right, up = build_basis(self.axis)
        points: Array = np.asarray(self.position, float) + self.radius * (places[:, :1] * right + places[:, 1:] * up)
        return points

    def covers(self, offsets: Array) -> Bools:
        """Return whether points lie within its radius."""
        inside: Bools = np.einsum("ij,ij->i", offsets, offsets) <= self.radius**2
        return inside

    def outline(self, bounds: Bounds) -> Array:
        """Return its edge and its normal."""
        normal = draw_arrow(self.position, self.axis, SIZE * bounds.radius)
        return np.concatenate([draw_circle(self.position, self.axis, self.radius), normal])


LIGHT = Disc
