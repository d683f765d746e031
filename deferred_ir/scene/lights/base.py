"""What every kind of direct light answers: the interface that casting, ray-cast direct light and the GPU buffers use.

A kind of light is a file beside this one and a file of the same name in shaders/lib/lights. The path tracer, the judge
of the others, keeps its own formulas.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol

from deferred_ir.base.arrays import Array, Vec3


@dataclass(frozen=True, eq=False)
class LightView:
    """What one shadow map of a light must cover: a cone. axis: unit, (3,). fov: full opening angle, degrees."""

    position: Vec3
    axis: Array
    fov: float


class Light(Protocol):
    """A direct light. Points on it are given by points of the unit disc (n, 2), `places`; None for a point light."""

    @property
    def emission(self) -> Vec3:
        """Factor on all of its light, linear RGB."""

    @property
    def has_area(self) -> bool:
        """Whether it casts soft shadows, so that rays need `places`."""

    def emit(self, points: Array, places: Array | None) -> tuple[Array, Array, Array]:
        """Return rays that together carry its light: origins and unit directions (n, 3), and what each carries (n, 3).

        points: of the unit disc, (n, 2), evenly spread. A ray that lands on a diffuse surface makes a VPL of intensity
        I(w) = carried * reflectance * cos(theta).
        """

    def locate(self, places: Array | None, count: int) -> Array:
        """Return `count` points on the light, (count, 3)."""

    def radiate(self, directions: Array) -> Array:
        """Return intensity over emission in unit `directions` (n, 3) from the light, (n,)."""

    def describe(self) -> Mapping[str, Any]:
        """Return its fields of a LIGHT record (frame/direct_lights.py) but for its views."""

    def list_views(self) -> tuple[LightView, ...]:
        """Return what its shadow maps must cover, a map each; none where its shadows need no map."""

    def at(self, time: float) -> Light:
        """Return the light where it is at `time` seconds of its motion."""

    def translate(self, by: Vec3) -> Light:
        """Return the light moved by a vector, at rest there."""
