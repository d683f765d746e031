"""The disc of a spotlight's directions in which equal areas get equal light.

Nusselt's analogue, uniform on the disc of radius sin(fov/2), has the light's cosine in it but not the soft edge of its
cone. Here radii are stretched so that it has both: what falls into a part of the disc is that part's share of all the
light, exactly, however coarse the parts are. With x = (1 - cos theta) / e, e = 1 - cos(fov/2), the light within an
angle theta of the axis goes with

    F(x) = integral of cone (1 - e x) dx,  cone = 1 up to x = 3/4, then 4 (1 - x).
"""

from __future__ import annotations

import numpy as np

from deferred_ir.base.arrays import Array
from deferred_ir.scene.lights.spot import Spotlight, one_minus_cos

FLAT = 0.75
"""Where the soft edge begins."""


class EmissionDisc:
    """The unit disc of `light`'s directions. axes: (2, 3), two unit vectors that span its plane."""

    def __init__(self, light: Spotlight, axes: Array) -> None:
        self._axis, self._axes, self._edge = light.axis, axes, one_minus_cos(light.fov)
        self._all = self._within(np.ones(1))[0]

    @property
    def power(self) -> float:
        """What the light sends out over E and pi, its soft edge included: r^2 times the mean of the cone."""
        return float(2 * self._edge * self._all)

    def _within(self, x: Array) -> Array:
        """F(x)."""
        e, soft = self._edge, np.maximum(x, FLAT)
        flat = np.minimum(x, FLAT)

        def ramp(x: Array | float) -> Array | float:
            return x - (1 + e) * x**2 / 2 + e * x**3 / 3

        within: Array = flat - e * flat**2 / 2 + 4 * (ramp(soft) - ramp(FLAT))
        return within

    def inside(self, directions: Array) -> np.ndarray:
        """Whether unit directions (n, 3) lie in the cone, bool (n,)."""
        inside: np.ndarray = self._off_axis(directions) < 1
        return inside

    def _off_axis(self, directions: Array) -> Array:
        """x, (n,). Without cancellation: 1 - cos theta = |w - a|^2 / 2."""
        x: Array = ((directions - self._axis) ** 2).sum(axis=1) / (2 * self._edge)
        return x

    def points(self, directions: Array) -> Array:
        """Points (n, 2) of the disc that unit directions (n, 3) in the cone stand for."""
        across = directions @ self._axes.T
        length = np.linalg.norm(across, axis=1)
        radius = np.sqrt(self._within(np.minimum(self._off_axis(directions), 1)) / self._all)
        points: Array = across * np.divide(radius, length, out=np.zeros(len(length)), where=length > 0)[:, None]
        return points

    def directions(self, points: Array) -> Array:
        """The reverse."""
        square = (points**2).sum(axis=1)
        low, high = np.zeros(len(points)), np.ones(len(points))
        for _ in range(53):  # bits of a float
            middle = (low + high) / 2
            below = self._within(middle) < square * self._all
            low, high = np.where(below, middle, low), np.where(below, high, middle)
        height = self._edge * high  # 1 - cos theta
        scale = np.sqrt(np.divide(height * (2 - height), square, out=np.zeros(len(points)), where=square > 0))
        directions: Array = (points * scale[:, None]) @ self._axes + (1 - height[:, None]) * self._axis
        return directions
