"""Light from infinity in one direction, or from a disc of the sky such as the sun's: glTF's `directional`."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from deferred_ir.base.arrays import Array, Vec3
from deferred_ir.base.colour import LUMINANCE
from deferred_ir.sampling.warps import build_basis, lift_to_hemisphere
from deferred_ir.scene.lights.base import Arrivals, Bounds, Flux, LightView, end_outside, enter
from deferred_ir.scene.lights.fields import Fault, PlacedLight
from deferred_ir.scene.motion import LightMotion
from deferred_ir.scene.outlines import SIZE, draw_arrow


@dataclass(frozen=True)
class Directional(PlacedLight):
    """Shines along look_at - position; where these lie does not matter.

    irradiance: on a plane that faces it, W/m^2, linear RGB; angle: full diameter of its disc, degrees.
    """

    kind: ClassVar[str] = "directional"
    view_halvings: ClassVar[tuple[int, ...]] = (0,)
    position: Vec3
    look_at: Vec3
    irradiance: Vec3 = (1.0, 1.0, 1.0)
    angle: float = 0.0
    motion: LightMotion | None = None

    def find_faults(self) -> Iterator[Fault]:
        """Yield what is wrong with the values."""
        yield from super().find_faults()
        yield from self.find_number_faults("angle", 0, 90, " degrees")

    @property
    def emission(self) -> Vec3:
        """Its irradiance."""
        return self.irradiance

    @property
    def has_area(self) -> bool:
        """Whether it is a disc."""
        return self.angle > 0

    @property
    def _sine(self) -> float:
        """Sine of the half angle of its disc."""
        return math.sin(math.radians(self.angle) / 2)

    def emit(self, points: Array, places: Array | None, bounds: Bounds) -> Flux:
        """Return parallel rays that cover the scene; with a disc, their directions differ."""
        directions = np.broadcast_to(self.axis, (len(points), 3))
        each = np.full(len(points), bounds.radius**2 / len(points))
        if places is not None:
            directions = lift_to_hemisphere(places * self._sine, self.axis[None])
            each = each / (directions @ self.axis)
        return (
            enter(directions, points, bounds),
            directions,
            np.multiply.outer(each, np.asarray(self.irradiance, float)),
        )

    def measure_flux(self, bounds: Bounds) -> float:
        """Return the luminous flux over pi through the scene's bounds."""
        return float(bounds.radius**2 * (LUMINANCE @ np.asarray(self.irradiance, float)))

    def sample(self, at: Array, places: Array | None, bounds: Bounds) -> Arrivals:
        """Return what arrives."""
        to = np.broadcast_to(-self.axis, at.shape)
        strength = np.ones(len(at))
        if places is not None:
            # Uniform over the disc as seen by a plane that faces it.
            to = lift_to_hemisphere(places * self._sine, -self.axis[None])
            strength = 1 / -(to @ self.axis)
        return Arrivals(to, end_outside(at, to, bounds), strength)

    def describe(self) -> Mapping[str, Any]:
        """Return its fields of a LIGHT record."""
        return {"axis": self.axis, "emission": self.irradiance, "radius": math.tan(math.radians(self.angle) / 2)}

    def list_views(self, bounds: Bounds) -> tuple[LightView, ...]:
        """Return a view of the whole scene."""
        start = np.asarray(bounds.centre) - bounds.radius * self.axis
        x, y, z = start.tolist()
        return (LightView((x, y, z), self.axis, 0.0, reach=bounds.radius, depth=2 * bounds.radius),)

    def outline(self, bounds: Bounds) -> Array:
        """Return parallel arrows."""
        length = SIZE * bounds.radius
        right, up = build_basis(self.axis)
        starts = np.asarray(self.position, float) + length / 2 * np.array([0 * up, right, up, -right, -up])
        return np.concatenate([draw_arrow(start, self.axis, 2 * length) for start in starts])


LIGHT = Directional
