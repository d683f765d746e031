"""Map a light's directions to a disc on which equal areas get equal light.

A point's sphere of directions is mapped by Lambert's azimuthal projection; the disc's rim is one direction. A
spotlight's cone takes more:

Nusselt's analogue, uniform on the disc of radius sin(fov/2), accounts for the light's cosine but not for the soft edge
of its cone. Here radii are stretched to account for both: any region of the disc gets exactly the fraction of the light
that it has of the area. With x = (1 - cos theta) / e, e = 1 - cos(fov/2), the light within an angle theta of the axis
is proportional to

    F(x) = integral of cone (1 - e x) dx,  cone = 1 up to x = 3/4, then 4 (1 - x).
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

from deferred_ir.base.arrays import Array
from deferred_ir.scene.lights.point import Point
from deferred_ir.scene.lights.spotlight import Spotlight, one_minus_cos

FLAT = 0.75
"""x at which the soft edge begins."""


class SpotlightDisc:
    """The unit disc of the directions of `light`. axes: (2, 3), two unit vectors that span its plane."""

    def __init__(self, light: Spotlight, axes: Array) -> None:
        self._axis, self._axes, self._edge = light.axis, axes, one_minus_cos(light.fov)
        self._all = self._within(np.ones(1))[0]

    @property
    def power(self) -> float:
        """The light's power over E and pi, its soft edge included: r^2 times the mean of the cone."""
        return float(2 * self._edge * self._all)

    def _within(self, x: Array) -> Array:
        """Return F(x)."""
        e, soft = self._edge, np.maximum(x, FLAT)
        flat = np.minimum(x, FLAT)

        def ramp(x: Array | float) -> Array | float:
            return x - (1 + e) * x**2 / 2 + e * x**3 / 3

        within: Array = flat - e * flat**2 / 2 + 4 * (ramp(soft) - ramp(FLAT))
        return within

    def inside(self, directions: Array) -> np.ndarray:
        """Return whether unit directions (n, 3) lie in the cone, bool (n,)."""
        inside: np.ndarray = self._off_axis(directions) < 1
        return inside

    def _off_axis(self, directions: Array) -> Array:
        """Return x of unit directions (n, 3), (n,), without cancellation: 1 - cos theta = |w - a|^2 / 2."""
        x: Array = ((directions - self._axis) ** 2).sum(axis=1) / (2 * self._edge)
        return x

    def project(self, directions: Array) -> Array:
        """Return the points (n, 2) of the disc to which unit directions (n, 3) in the cone belong."""
        across = directions @ self._axes.T
        length = np.linalg.norm(across, axis=1)
        radius = np.sqrt(self._within(np.minimum(self._off_axis(directions), 1)) / self._all)
        points: Array = across * np.divide(radius, length, out=np.zeros(len(length)), where=length > 0)[:, None]
        return points

    def unproject(self, points: Array) -> Array:
        """Return the unit directions (n, 3) that belong to points (n, 2) of the disc."""
        square = (points**2).sum(axis=1)
        height = self._edge * self._find_x(square * self._all)  # 1 - cos theta
        scale = np.sqrt(np.divide(height * (2 - height), square, out=np.zeros(len(points)), where=square > 0))
        directions: Array = (points * scale[:, None]) @ self._axes + (1 - height[:, None]) * self._axis
        return directions

    def _find_x(self, within: Array) -> Array:
        """Return x where F(x) is `within` (n,), (n,): the root of a square before the soft edge, by bisection there."""
        x: Array = 2 * within / (1 + np.sqrt(np.maximum(1 - 2 * self._edge * within, 0)))
        soft = np.flatnonzero(x > FLAT)
        if len(soft):
            low, high = np.full(len(soft), FLAT), np.ones(len(soft))
            for _ in range(53):  # bits of a float
                middle = (low + high) / 2
                below = self._within(middle) < within[soft]
                low, high = np.where(below, middle, low), np.where(below, high, middle)
            x[soft] = high
        return x


class PointDisc:
    """The unit disc of all directions. axes: (2, 3), two unit vectors; their cross product lies in its middle."""

    power = 4.0

    def __init__(self, axes: Array) -> None:
        self._axes, self._axis = axes, np.cross(axes[0], axes[1])

    def inside(self, directions: Array) -> np.ndarray:
        """Return whether unit directions (n, 3) get light: all do."""
        return np.ones(len(directions), bool)

    def project(self, directions: Array) -> Array:
        """Return the points (n, 2) of the disc to which unit directions (n, 3) belong."""
        across = directions @ self._axes.T
        length = np.linalg.norm(across, axis=1)
        radius = np.linalg.norm(directions - self._axis, axis=1) / 2  # sqrt((1 - cos) / 2)
        points: Array = across * np.divide(radius, length, out=np.zeros(len(length)), where=length > 0)[:, None]
        return points

    def unproject(self, points: Array) -> Array:
        """Return the unit directions (n, 3) that belong to points (n, 2) of the disc."""
        square = np.minimum((points**2).sum(axis=1), 1)[:, None]
        directions: Array = 2 * np.sqrt(1 - square) * (points @ self._axes) + (1 - 2 * square) * self._axis
        return directions


class EmissionDisc(Protocol):
    """The disc of a light's directions."""

    @property
    def power(self) -> float:
        """The light's flux over its emission and pi."""

    def inside(self, directions: Array) -> np.ndarray:
        """Return whether unit directions (n, 3) get light, bool (n,)."""

    def project(self, directions: Array) -> Array:
        """Return the points (n, 2) of the disc to which unit directions (n, 3) that get light belong."""

    def unproject(self, points: Array) -> Array:
        """Return the unit directions (n, 3) that belong to points (n, 2) of the disc."""


KeptLight = Spotlight | Point
"""Lights that have such a disc."""


def find_axis(light: KeptLight) -> Array:
    """Return the unit direction in the middle of the light's disc, (3,)."""
    return light.axis if isinstance(light, Spotlight) else np.array([0.0, 0.0, 1.0])


def make_disc(light: KeptLight, axes: Array) -> EmissionDisc:
    """Return the disc of a light. axes: (2, 3), two unit vectors that span its plane."""
    return SpotlightDisc(light, axes) if isinstance(light, Spotlight) else PointDisc(axes)
