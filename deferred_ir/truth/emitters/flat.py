"""Parts of a plane that shine to one side with constant radiance, and hide nothing."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from deferred_ir.base.arrays import Array, Bools
from deferred_ir.rays.tracer import Hits
from deferred_ir.truth.emitters.base import LUMINANCE, TINY, Arriving, Twin, aim, dot, find_axes


@dataclass(frozen=True, eq=False)
class FlatTwin(Twin):
    """A part of a plane. Bounces meet it, since close to it they are the better samples."""

    can_be_met: ClassVar[bool] = True
    is_seen: ClassVar[bool] = False

    @property
    @abstractmethod
    def area(self) -> float:
        """Its area."""

    @abstractmethod
    def place(self, points: Array) -> Array:
        """Map points of the unit square (n, 2) to it, in coordinates right and up from its middle, preserving area."""

    @abstractmethod
    def covers(self, places: Array) -> Bools:
        """Return which places (n, 2), right and up from its middle, lie on it."""

    @cached_property
    def _axes(self) -> Array:
        """Its normal, right and up."""
        towards = np.subtract(self.light.look_at, self.light.position)
        return find_axes(towards, getattr(self.light, "up", None))

    @cached_property
    def emission(self) -> Array:
        """Its radiance."""
        return np.asarray(self.light.radiance, float)

    @property
    def power(self) -> float:
        """Its luminous flux."""
        return float(np.pi * self.area * (LUMINANCE @ self.emission))

    @property
    def spreads(self) -> bool:
        """It does."""
        return True

    def sample(self, at: Array, points: Array) -> Arriving:
        """Return what arrives."""
        source = np.asarray(self.light.position, float) + self.place(points) @ self._axes[1:]
        to, square = aim(source, at)
        shining = -(to @ self._axes[0])
        return Arriving(to, source, (shining > 0) * 1.0, square / np.maximum(self.area * np.abs(shining), TINY))

    def meet(self, origins: Array, directions: Array, found: Hits) -> tuple[Array, Array]:
        """Return the radiance of rays that cross it ahead of the surface that they hit."""
        shining = -(directions @ self._axes[0])
        off = origins - np.asarray(self.light.position, float)
        reach = (off @ self._axes[0]) / np.where(shining > 0, shining, 1)
        way = found.position - origins
        free = ~found.hit | (reach**2 < dot(way, way))
        crossing = (off + reach[:, None] * directions) @ self._axes[1:].T
        met = (shining > 0) & (reach > 0) & free & self.covers(crossing)
        return met * 1.0, reach**2 / (self.area * np.where(shining > 0, shining, 1))
