"""The spotlight of docs/conventions.md: I(w) = E cos(theta) cone(theta) [W/sr per channel], theta from its axis."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from deferred_ir.base.arrays import Array, Vec3, add_vec3
from deferred_ir.sampling.warps import build_basis, lift_to_hemisphere
from deferred_ir.scene.lights.base import LightView
from deferred_ir.scene.motion import SpotlightMotion


@dataclass(frozen=True)
class Spotlight:
    """position, look_at: world space; fov: full opening angle, degrees; emission: E, linear RGB; radius: of a disc."""

    position: Vec3
    look_at: Vec3
    fov: float = 80.0
    emission: Vec3 = (1.0, 1.0, 1.0)
    radius: float = 0.0
    motion: SpotlightMotion | None = None

    @cached_property
    def axis(self) -> Array:
        """Unit direction in which it looks, float64 (3,)."""
        axis = np.subtract(self.look_at, self.position).astype(np.float64)
        unit: Array = axis / np.linalg.norm(axis)
        return unit

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

    def emit(self, points: Array, places: Array | None) -> tuple[Array, Array, Array]:
        """Return rays that together carry its light: origins and unit directions (n, 3), and what each carries (n, 3).

        points: of the unit disc, (n, 2), which Nusselt's analogue lifts to the cone. places: see `locate`.
        """
        reach = np.sin(np.radians(self.fov) / 2)
        directions = lift_to_hemisphere(points * reach, self.axis[None])
        carried = np.multiply.outer(self.cone(directions) * reach**2 / len(points), np.asarray(self.emission, float))
        return self.locate(places, len(points)), directions, carried

    def locate(self, places: Array | None, count: int) -> Array:
        """Return `count` points on the light, (count, 3). places: on the unit disc, (count, 2); None for its middle."""
        middle = np.broadcast_to(np.asarray(self.position, float), (count, 3))
        if places is None:
            return middle
        right, up = build_basis(self.axis)
        return middle + self.radius * (places[:, :1] * right + places[:, 1:] * up)

    def radiate(self, directions: Array) -> Array:
        """Return intensity over emission in unit `directions` (n, 3) from the light, (n,)."""
        intensity: Array = np.maximum(directions @ self.axis, 0) * self.cone(directions)
        return intensity

    def describe(self) -> Mapping[str, Any]:
        """Return its fields of a LIGHT record."""
        shape = {"position": self.position, "axis": self.axis, "one_minus_cos": one_minus_cos(self.fov)}
        return {**shape, "radius": self.radius, "emission": self.emission}

    def list_views(self) -> tuple[LightView, ...]:
        """Return its only view: all of its cone."""
        return (LightView(self.position, self.axis, self.fov),)

    def at(self, time: float) -> Spotlight:
        """Return the spotlight where it is at `time` seconds of its motion."""
        if self.motion is None:
            return self
        position, look_at = self.motion.move(self.position, self.look_at, time)
        return replace(self, position=position, look_at=look_at)

    def translate(self, by: Vec3) -> Spotlight:
        """Return the spotlight moved by a vector, at rest there."""
        position, look_at = add_vec3(self.position, by), add_vec3(self.look_at, by)
        return replace(self, position=position, look_at=look_at, motion=None)


def one_minus_cos(fov: float) -> float:
    """1 - cos(fov/2) for a full opening angle in degrees."""
    return 2 * math.sin(math.radians(fov) / 4) ** 2
