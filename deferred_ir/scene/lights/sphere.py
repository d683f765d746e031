"""A sphere that shines all around with constant radiance."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from deferred_ir.base.arrays import Array, Vec3
from deferred_ir.base.colour import LUMINANCE
from deferred_ir.sampling.warps import build_basis, disc_to_sphere, lift_to_hemisphere, square_to_sphere
from deferred_ir.scene.lights.base import Arrivals, Bounds, Flux, LightSamples, Meetings
from deferred_ir.scene.lights.fields import Fault, PlacedLight
from deferred_ir.scene.motion import LightMotion
from deferred_ir.scene.outlines import draw_ball


@dataclass(frozen=True)
class Sphere(PlacedLight):
    """position: of its middle, world space; radius: scene units; radiance: W/(m^2 sr), linear RGB."""

    kind: ClassVar[str] = "sphere"
    at_infinity: ClassVar[bool] = False
    position: Vec3
    radius: float
    radiance: Vec3 = (1.0, 1.0, 1.0)
    motion: LightMotion | None = None

    def find_faults(self) -> Iterator[Fault]:
        """Yield what is wrong with the values."""
        yield from super().find_faults()
        yield from self.find_number_faults("radius", 0, open_ends=True)

    @property
    def emission(self) -> Vec3:
        """Its radiance."""
        return self.radiance

    @property
    def has_area(self) -> bool:
        """It has."""
        return True

    def emit(self, points: Array, places: Array | None, bounds: Bounds) -> Flux:
        """Return rays that leave places on it, cosine-distributed."""
        del bounds
        assert places is not None
        normals = disc_to_sphere(places)
        carried = np.asarray(self.radiance, float) * (4 * np.pi * self.radius**2 / len(points))
        origins = np.asarray(self.position, float) + self.radius * normals
        return origins, lift_to_hemisphere(points, normals), np.tile(carried, (len(points), 1))

    def measure_flux(self, bounds: Bounds) -> float:
        """Return its luminous flux over pi."""
        del bounds
        return float(4 * np.pi * self.radius**2 * (LUMINANCE @ np.asarray(self.radiance, float)))

    def spread(self, square: Array, bounds: Bounds) -> LightSamples:
        """Return points on it, all with the same part of its light."""
        del bounds
        normals = square_to_sphere(square)
        each = np.asarray(self.radiance, float) * (4 * np.pi * self.radius**2 / len(square))
        position = np.asarray(self.position, float) + self.radius * normals
        return LightSamples(position, normals, np.tile(each, (len(square), 1)))

    def sample(self, at: Array, places: Array | None, bounds: Bounds) -> Arrivals:
        """Return what arrives from the half that is seen, uniform in solid angle; nothing inside."""
        del bounds
        assert places is not None
        return sample_ball(np.asarray(self.position, float), self.radius, at, places)

    def meet(self, origins: Array, directions: Array) -> Meetings:
        """Return where rays meet it from outside."""
        way = np.asarray(self.position, float) - origins
        along = np.einsum("ij,ij->i", way, directions)
        side = way - along[:, None] * directions
        square = self.radius**2 - np.einsum("ij,ij->i", side, side)
        away = np.einsum("ij,ij->i", way, way)
        outside = away > self.radius**2
        hit = (square > 0) & (along > 0) & outside
        distance = np.where(hit, along - np.sqrt(np.maximum(square, 0)), np.inf)
        sine_squared = np.where(outside, self.radius**2 / np.maximum(away, np.finfo(float).tiny), 1)
        cap = sine_squared / (1 + np.sqrt(1 - sine_squared))
        radiance = np.multiply.outer(hit.astype(float), np.asarray(self.radiance))
        return Meetings(distance, radiance, np.where(hit, 1 / (2 * np.pi * cap), 0.0))

    def outline(self, bounds: Bounds) -> Array:
        """Return circles of it."""
        del bounds
        return draw_ball(self.position, self.radius)


def sample_ball(centre: Array, radius: float, at: Array, places: Array) -> Arrivals:
    """Return what arrives at points `at` (n, 3) from a ball of radiance 1, uniform in solid angle; nothing inside it.

    places: of the unit disc, (n, 2).
    """
    way = centre - at
    square = np.einsum("ij,ij->i", way, way)
    outside = square > radius**2
    distance = np.sqrt(np.where(outside, square, radius**2 * 2))
    axis = np.where(outside[:, None], way, [0.0, 0.0, np.sqrt(2) * radius]) / distance[:, None]
    # 1 - cos of the cone, without cancellation: sin^2 / (1 + cos).
    sine_squared = (radius / distance) ** 2
    cap = sine_squared / (1 + np.sqrt(1 - sine_squared))
    along = cap * (places**2).sum(axis=1)  # 1 - cos of a direction: uniform in solid angle
    across = np.sqrt(np.maximum(along * (2 - along), 0))
    length = np.linalg.norm(places, axis=1)
    part = places * np.divide(across, length, out=np.zeros(len(length)), where=length > 0)[:, None]
    right, up = build_basis(axis)
    to = part[:, :1] * right + part[:, 1:] * up + (1 - along)[:, None] * axis
    reach = distance * (1 - along)
    near = reach - np.sqrt(np.maximum(radius**2 - distance**2 * across**2, 0))
    over = 2 * np.pi * cap
    return Arrivals(to, at + to * near[:, None], np.where(outside, over, 0.0), 1 / over)


LIGHT = Sphere
