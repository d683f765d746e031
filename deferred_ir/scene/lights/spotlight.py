"""The spotlight of docs/conventions.md: I(w) = E cos(theta) cone(theta) [W/sr per channel], theta from its axis."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from deferred_ir.base.arrays import Array, Vec3
from deferred_ir.base.colour import LUMINANCE
from deferred_ir.sampling.warps import build_basis, lift_to_hemisphere
from deferred_ir.scene.lights.base import Arrivals, Bounds, Flux, LightView, aim
from deferred_ir.scene.lights.fields import Fault, PlacedLight
from deferred_ir.scene.motion import LightMotion
from deferred_ir.scene.outlines import SIZE, draw_arrow, draw_circle, draw_cone


@dataclass(frozen=True)
class Spotlight(PlacedLight):
    """position, look_at: world space; fov: full opening angle, degrees; emission: E, linear RGB; radius: of a disc."""

    kind: ClassVar[str] = "spotlight"
    view_halvings: ClassVar[tuple[int, ...]] = (0,)
    position: Vec3
    look_at: Vec3
    fov: float = 80.0
    emission: Vec3 = (1.0, 1.0, 1.0)
    radius: float = 0.0
    motion: LightMotion | None = None

    def find_faults(self) -> Iterator[Fault]:
        """Yield what is wrong with the values."""
        yield from super().find_faults()
        yield from self.find_number_faults("fov", 0, 180, " degrees", open_ends=True)
        yield from self.find_number_faults("radius", 0)

    def cone(self, directions: Array) -> Array:
        """Soft edge clamp(4 (cos theta - cos(fov/2)) / (1 - cos(fov/2)), 0, 1) for unit directions (..., 3).

        1 - cos theta = |w - a|^2 / 2 and 1 - cos(fov/2) = 2 sin^2(fov/4): plain differences cancel for narrow cones.
        """
        off_axis = ((directions - self.axis) ** 2).sum(axis=-1) / 2
        edge = one_minus_cos(self.fov)
        inside: Array = np.clip(4 * (edge - off_axis) / edge, 0, 1)
        return inside

    @property
    def has_area(self) -> bool:
        """Whether it is a disc."""
        return self.radius > 0

    def emit(self, points: Array, places: Array | None, bounds: Bounds) -> Flux:
        """Return rays that together carry its light; Nusselt's analogue lifts `points` to the cone."""
        del bounds
        reach = np.sin(np.radians(self.fov) / 2)
        directions = lift_to_hemisphere(points * reach, self.axis[None])
        carried = np.multiply.outer(self.cone(directions) * reach**2 / len(points), np.asarray(self.emission, float))
        return self._locate(places, len(points)), directions, carried

    def measure_flux(self, bounds: Bounds) -> float:
        """Return its luminous flux over pi: 2 times the integral of cos cone d(cos), the soft edge included."""
        del bounds
        edge = one_minus_cos(self.fov)
        # With x = (1 - cos theta) / edge the cone is 1 up to 3/4, then 4 (1 - x).
        within = 0.75 - edge * 0.75**2 / 2 + 4 * (_ramp(1.0, edge) - _ramp(0.75, edge))
        return float(2 * edge * within * (LUMINANCE @ np.asarray(self.emission, float)))

    def _locate(self, places: Array | None, count: int) -> Array:
        """Return `count` points on the light, (count, 3). places: on the unit disc, (count, 2); None for its middle."""
        middle = np.broadcast_to(np.asarray(self.position, float), (count, 3))
        if places is None:
            return middle
        right, up = build_basis(self.axis)
        return middle + self.radius * (places[:, :1] * right + places[:, 1:] * up)

    def sample(self, at: Array, places: Array | None, bounds: Bounds) -> Arrivals:
        """Return what arrives at points `at` (n, 3)."""
        del bounds
        source = self._locate(places, len(at))
        to, square = aim(source, at)
        return Arrivals(to, source, self.radiate(-to) / square)

    def radiate(self, directions: Array) -> Array:
        """Return intensity over emission in unit `directions` (n, 3) from the light, (n,)."""
        intensity: Array = np.maximum(directions @ self.axis, 0) * self.cone(directions)
        return intensity

    def describe(self) -> Mapping[str, Any]:
        """Return its fields of a LIGHT record."""
        shape = {"position": self.position, "axis": self.axis, "one_minus_cos": one_minus_cos(self.fov)}
        return {**shape, "radius": self.radius, "emission": self.emission}

    def list_views(self, bounds: Bounds) -> tuple[LightView, ...]:
        """Return its only view: all of its cone."""
        del bounds
        return (LightView(self.position, self.axis, self.fov),)

    def outline(self, bounds: Bounds) -> Array:
        """Return its cone, its axis and its disc."""
        length = SIZE * bounds.radius
        cone = draw_cone(self.position, self.axis, self.fov, length)
        disc = [draw_circle(self.position, self.axis, self.radius)] if self.radius else []
        return np.concatenate([cone, draw_arrow(self.position, self.axis, 1.5 * length), *disc])


def one_minus_cos(fov: float) -> float:
    """1 - cos(fov/2) for a full opening angle in degrees."""
    return 2 * math.sin(math.radians(fov) / 4) ** 2


def _ramp(x: float, edge: float) -> float:
    """Return the integral of (1 - x) (1 - edge x)."""
    return x - (1 + edge) * x**2 / 2 + edge * x**3 / 3


LIGHT = Spotlight
