"""glTF's punctual spot: constant intensity within an inner cone, smoothly down to 0 at an outer one, no cosine."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from deferred_ir.base.arrays import Array, Vec3
from deferred_ir.base.colour import LUMINANCE
from deferred_ir.sampling.warps import disc_to_cone
from deferred_ir.scene.lights.base import Arrivals, Bounds, Flux, LightView, aim
from deferred_ir.scene.lights.fields import Fault, PlacedLight
from deferred_ir.scene.lights.spotlight import one_minus_cos
from deferred_ir.scene.motion import LightMotion
from deferred_ir.scene.outlines import SIZE, draw_arrow, draw_cone

NARROWEST = 1e-3
"""Least difference of the cosines of both cones, as in KHR_lights_punctual."""


@dataclass(frozen=True)
class Spot(PlacedLight):
    """position, look_at: world space; intensity: W/sr, linear RGB; fov, inner_fov: full opening angles, degrees.

    Its intensity is clamp((cos theta - cos(fov/2)) / max(0.001, cos(inner_fov/2) - cos(fov/2)), 0, 1)^2 of that.
    """

    kind: ClassVar[str] = "spot"
    view_halvings: ClassVar[tuple[int, ...]] = (0,)
    position: Vec3
    look_at: Vec3
    fov: float = 90.0
    inner_fov: float = 0.0
    intensity: Vec3 = (1.0, 1.0, 1.0)
    motion: LightMotion | None = None

    def find_faults(self) -> Iterator[Fault]:
        """Yield what is wrong with the values."""
        yield from super().find_faults()
        yield from self.find_number_faults("fov", 0, 180, " degrees", open_ends=True)
        yield from self.find_number_faults("inner_fov", 0, 180, " degrees")
        if isinstance(self.inner_fov, float) and isinstance(self.fov, float) and self.inner_fov > self.fov:
            yield "inner_fov", f"must not be more than fov, {self.fov:g}, but is {self.inner_fov:g}"

    @property
    def emission(self) -> Vec3:
        """Its intensity along its axis."""
        return self.intensity

    @property
    def has_area(self) -> bool:
        """It has none."""
        return False

    @property
    def _edges(self) -> tuple[float, float]:
        """1 - cos of the outer cone's half angle, and how much less that of the inner one is."""
        outer = one_minus_cos(self.fov)
        return outer, max(NARROWEST, outer - one_minus_cos(self.inner_fov))

    def radiate(self, directions: Array) -> Array:
        """Return intensity over that along the axis in unit `directions` (n, 3) from the light, (n,)."""
        outer, soft = self._edges
        off_axis = ((directions - self.axis) ** 2).sum(axis=-1) / 2
        intensity: Array = np.clip((outer - off_axis) / soft, 0, 1) ** 2
        return intensity

    def emit(self, points: Array, places: Array | None, bounds: Bounds) -> Flux:
        """Return rays in the cone, uniform in solid angle."""
        del places, bounds
        outer, _ = self._edges
        directions = disc_to_cone(points, self.axis, outer)
        carried = np.multiply.outer(self.radiate(directions) * (2 * outer / len(points)), self.intensity)
        return np.broadcast_to(np.asarray(self.position, float), directions.shape), directions, carried

    def measure_flux(self, bounds: Bounds) -> float:
        """Return its luminous flux over pi."""
        del bounds
        outer, soft = self._edges
        flat = max(outer - soft, 0.0)  # 1 - cos where it begins to fall
        ramp = (outer - flat) ** 3 / (3 * soft**2)
        return float(2 * (flat + ramp) * (LUMINANCE @ np.asarray(self.intensity, float)))

    def sample(self, at: Array, places: Array | None, bounds: Bounds) -> Arrivals:
        """Return what arrives."""
        del places, bounds
        source = np.asarray(self.position, float)
        to, square = aim(source, at)
        return Arrivals(to, np.broadcast_to(source, at.shape), self.radiate(-to) / square)

    def describe(self) -> Mapping[str, Any]:
        """Return its fields of a LIGHT record."""
        outer, soft = self._edges
        place = {"position": self.position, "axis": self.axis, "emission": self.intensity}
        return {**place, "one_minus_cos": outer, "soft_edge": soft}

    def list_views(self, bounds: Bounds) -> tuple[LightView, ...]:
        """Return its only view: all of its cone."""
        del bounds
        return (LightView(self.position, self.axis, self.fov),)

    def outline(self, bounds: Bounds) -> Array:
        """Return both of its cones and its axis."""
        length = SIZE * bounds.radius
        cones = [draw_cone(self.position, self.axis, fov, length) for fov in {self.fov, self.inner_fov} - {0.0}]
        return np.concatenate([*cones, draw_arrow(self.position, self.axis, 1.5 * length)])


LIGHT = Spot
