"""What lights share that are a part of a plane: one-sided, with constant radiance."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator
from typing import ClassVar

import numpy as np

from deferred_ir.base.arrays import Array, Bools, Vec3
from deferred_ir.base.colour import LUMINANCE
from deferred_ir.sampling.warps import lift_to_hemisphere, square_to_disc
from deferred_ir.scene.lights.base import Arrivals, Bounds, Flux, LightSamples, Meetings, aim
from deferred_ir.scene.lights.fields import Fault, PlacedLight


class FlatLight(PlacedLight):
    """A part of the plane through `position` that faces `look_at`."""

    at_infinity: ClassVar[bool] = False
    look_at: Vec3
    radiance: Vec3

    @property
    @abstractmethod
    def area(self) -> float:
        """Its area, square scene units."""

    @abstractmethod
    def covers(self, offsets: Array) -> Bools:
        """Return whether points of its plane, as offsets (n, 3) from its middle, are on it, bool (n,)."""

    @abstractmethod
    def locate(self, places: Array) -> Array:
        """Return points on it, (n, 3), evenly spread as `places` (n, 2) of the unit disc are."""

    def find_faults(self) -> Iterator[Fault]:
        """Yield what is wrong with the values."""
        yield from super().find_faults()

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
        carried = np.asarray(self.radiance, float) * (self.area / len(points))
        return self.locate(places), lift_to_hemisphere(points, self.axis[None]), np.tile(carried, (len(points), 1))

    def measure_flux(self, bounds: Bounds) -> float:
        """Return its luminous flux over pi."""
        del bounds
        return float(self.area * (LUMINANCE @ np.asarray(self.radiance, float)))

    def spread(self, square: Array, bounds: Bounds) -> LightSamples:
        """Return points on it, all with the same part of its light."""
        del bounds
        each = np.asarray(self.radiance, float) * (self.area / len(square))
        normals = np.tile(self.axis, (len(square), 1))
        return LightSamples(self.locate(square_to_disc(square)), normals, np.tile(each, (len(square), 1)))

    def sample(self, at: Array, places: Array | None, bounds: Bounds) -> Arrivals:
        """Return what arrives from a place on it."""
        del bounds
        assert places is not None
        source = self.locate(places)
        to, square = aim(source, at)
        over = self.area * np.maximum(-(to @ self.axis), 0) / square
        return Arrivals(to, source, over, _invert(over))

    def meet(self, origins: Array, directions: Array) -> Meetings:
        """Return where rays meet its front."""
        against, height = -(directions @ self.axis), (origins - np.asarray(self.position, float)) @ self.axis
        ahead = (against > 0) & (height > 0)
        distance = np.divide(height, against, out=np.full(len(height), np.inf), where=ahead)
        at = np.where(ahead, distance, 0)[:, None] * directions + origins - np.asarray(self.position, float)
        hit = ahead & self.covers(at)
        distance[~hit] = np.inf
        density = np.zeros(len(distance))
        density[hit] = _invert(self.area * against[hit] / distance[hit] ** 2)
        return Meetings(distance, np.multiply.outer(hit.astype(float), np.asarray(self.radiance)), density)


def _invert(values: Array) -> Array:
    """Return 1 over values (n,), infinite for 0."""
    inverse: Array = np.divide(1, values, out=np.full(len(values), np.inf), where=values > 0)
    return inverse
