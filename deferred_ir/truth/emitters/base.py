"""What the path tracer asks of whatever shines: its twin of a kind of light, with formulas of its own.

A twin is a file beside this one, named as the kind, that says `TWIN = TheClass`; it reads fields of the light and calls
none of its methods, so that no fault can hide in both.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, Protocol

import numpy as np

from deferred_ir.base.arrays import Array
from deferred_ir.rays.tracer import Hits

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
"""Weights of linear red, green and blue in luminance (Rec. 709)."""
TINY = float(np.finfo(float).tiny)


@dataclass(frozen=True, eq=False)
class Arriving:
    """Light that arrives at n points from one point of an emitter each.

    to: unit directions towards it, (n, 3). ends: where shadow rays end, (n, 3). strength and over: on a plane that
    faces it, without shadows, irradiance is emission * strength / over. strength: (n,) or (n, 3). What has an area has
    radiance as strength, over the density of the directions over solid angle, (n,); points, the squared distance.
    own_density: that of the directions of what has an area, where `over` is something else.
    """

    to: Array
    ends: Array
    strength: Array
    over: Array
    own_density: Array | None = None

    @property
    def density(self) -> Array:
        """Density of the directions over solid angle, (n,), of what has an area."""
        return self.over if self.own_density is None else self.own_density


class Emitter(Protocol):
    """Anything that shines.

    can_be_met: whether rays of bounces may meet it, so that both ways of sampling share its light; rays by glossy parts
    meet all that spreads. is_seen: whether the camera sees it.
    """

    can_be_met: ClassVar[bool]
    is_seen: ClassVar[bool]

    @property
    def emission(self) -> Array:
        """Factor on all of its light, linear RGB (3,)."""

    @property
    def power(self) -> float:
        """About the luminous flux that may reach the scene; 0 if and only if it is dark."""

    @property
    def spreads(self) -> bool:
        """Whether it shines from more than one point or direction."""

    def sample(self, at: Array, points: Array) -> Arriving:
        """Return what arrives at points `at` (n, 3) from points (n, 2) of the unit square mapped to the emitter."""

    def meet(self, origins: Array, directions: Array, found: Hits) -> tuple[Array, Array]:
        """Return the radiance over emission along rays that hit `found`, (n,) or (n, 3), and the density of `sample`.

        directions: unit, (n, 3). Asked only of emitters that spread.
        """


@dataclass(frozen=True, eq=False)
class Surroundings:
    """The sphere about a scene's surfaces: what light from infinity enters. centre: (3,)."""

    centre: Array
    radius: float

    def leave(self, at: Array, to: Array) -> Array:
        """Return points (n, 3) outside on the way from points `at` (n, 3) inside in unit directions `to` (n, 3)."""
        ends: Array = at + to * (3 * self.radius)
        return ends


@dataclass(frozen=True, eq=False)
class Twin:
    """What most twins have. light: a light of the scene, of which only fields are read."""

    light: Any
    around: Surroundings
    can_be_met: ClassVar[bool] = False
    is_seen: ClassVar[bool] = False


def dot(a: Array, b: Array) -> Array:
    """Return the dot products of rows (n, 3), (n,)."""
    products: Array = np.einsum("ij,ij->i", a, b)
    return products


def find_axes(towards: Array, up: Array | None = None) -> Array:
    """Return the rows axis, right and up of an orthonormal frame, (3, 3): the axis points along `towards` (3,)."""
    axis = np.asarray(towards, np.float64)
    axis = axis / np.linalg.norm(axis)
    right = np.cross(axis, np.eye(3)[np.abs(axis).argmin()] if up is None else up)
    right /= np.linalg.norm(right)
    return np.stack([axis, right, np.cross(axis, right)])


def aim(source: Array, at: Array) -> tuple[Array, Array]:
    """Return unit directions (n, 3) from points `at` (n, 3) to points `source` (n, 3), and squared distances (n,)."""
    to = source - at
    distance = np.maximum(np.sqrt(dot(to, to)), 1e-150)
    to /= distance[:, None]
    return to, distance**2


def sample_cap(points: Array, axis: Array, height: Array | float) -> Array:
    """Return unit directions (n, 3), uniform in solid angle, in caps about unit `axis` (n, 3).

    height: 1 - cos of the caps' half angles, (n,) or one for all. Each direction is the axis mirrored by a half vector
    (Householder), which needs no frame about each axis.
    """
    down, angle = points[:, 0] * height, 2 * np.pi * points[:, 1]
    across = np.sqrt(np.maximum(down * (2 - down), 0))
    x, y, z = across * np.cos(angle), across * np.sin(angle), 1 - down
    # The reflection that swaps +z and the axis, or -z and the axis where that is farther from cancellation.
    sign = np.where(axis[:, 2] > 0, -1.0, 1.0)
    half = axis - np.stack([0 * sign, 0 * sign, sign], axis=1)
    half /= np.linalg.norm(half, axis=1, keepdims=True)
    local = np.stack([x, y, z * sign], axis=1)
    directions: Array = local - half * (2 * dot(half, local))[:, None]
    return directions
