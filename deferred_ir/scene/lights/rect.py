"""A rectangle of constant radiance that shines to one side."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from deferred_ir.base.arrays import Array, Bools, Vec3
from deferred_ir.base.errors import format_value
from deferred_ir.sampling.warps import disc_to_square
from deferred_ir.scene.lights.base import Bounds
from deferred_ir.scene.lights.fields import Fault, read_numbers
from deferred_ir.scene.lights.flat import FlatLight
from deferred_ir.scene.motion import LightMotion
from deferred_ir.scene.outlines import SIZE, draw_arrow, draw_polygon


@dataclass(frozen=True)
class Rect(FlatLight):
    """position: of its middle; shines towards look_at; size: across and along `up`, scene units.

    up: need not be at right angles to its direction. radiance: W/(m^2 sr), linear RGB.
    """

    kind: ClassVar[str] = "rect"
    position: Vec3
    look_at: Vec3
    size: tuple[float, float]
    up: Vec3 = (0.0, 1.0, 0.0)
    radiance: Vec3 = (1.0, 1.0, 1.0)
    motion: LightMotion | None = None

    def find_faults(self) -> Iterator[Fault]:
        """Yield what is wrong with the values."""
        yield from super().find_faults()
        numbers = read_numbers(self.size, 2)
        if isinstance(numbers, str):
            yield "size", numbers
        elif min(numbers) <= 0:
            yield "size", f"must be above 0 both ways, not {format_value(list(numbers))}"
        else:
            object.__setattr__(self, "size", numbers)

    @property
    def area(self) -> float:
        """Its area, square scene units."""
        return self.size[0] * self.size[1]

    @property
    def _sides(self) -> tuple[Array, Array]:
        """Its sides across and along `up`."""
        across = np.cross(self.axis, self.up)
        across /= np.linalg.norm(across)
        return self.size[0] * across, self.size[1] * np.cross(across, self.axis)

    def locate(self, places: Array) -> Array:
        """Return points on it, (n, 3), for `places` (n, 2) of the unit disc."""
        across, along = self._sides
        square = disc_to_square(places) - 0.5
        points: Array = np.asarray(self.position, float) + square[:, :1] * across + square[:, 1:] * along
        return points

    def covers(self, offsets: Array) -> Bools:
        """Return whether points lie within its sides."""
        inside = np.ones(len(offsets), bool)
        for side in self._sides:
            inside &= np.abs(offsets @ side) <= side @ side / 2
        return inside

    def outline(self, bounds: Bounds) -> Array:
        """Return its edges and its normal."""
        across, along = self._sides
        corners = np.array([-across - along, across - along, across + along, along - across]) / 2
        normal = draw_arrow(self.position, self.axis, SIZE * bounds.radius)
        return np.concatenate([draw_polygon(np.asarray(self.position, float) + corners), normal])


LIGHT = Rect
