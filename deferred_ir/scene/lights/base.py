"""What every kind of light answers: the interface that casting VPLs, direct light by rays and the GPU buffers use.

A kind is a file beside this one, which says at its end `LIGHT = TheClass`, and, if shaders evaluate it, a file of the
same name in shaders/lib/lights/kinds. The path tracer, the judge of the others, keeps formulas of its own.

There are two sorts. *Direct* lights (`DirectLight`) shine from a point, or from one direction, blurred a little at
most: shaders evaluate them, and a shadow map or a ray finds what they reach. *Sampled* lights (`SampledLight`) have an
area, or lie all around: they are replaced by points that are VPLs of bounce 0.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol, TypeGuard

import numpy as np

from deferred_ir.base.arrays import Array, Vec3


@dataclass(frozen=True)
class Bounds:
    """A sphere about all surfaces of a scene: light from infinity enters through its disc. centre: world space."""

    centre: Vec3
    radius: float


@dataclass(frozen=True, eq=False)
class LightView:
    """What one shadow map of a light must cover.

    position: where it looks from. axis: unit, (3,). fov: full opening angle, degrees; 0 for parallel light, which
    enters through a square of half-width `reach` about the position and goes on for `depth`, world units. halvings: how
    often the edge of the map is halved from that of a spotlight's.
    """

    position: Vec3
    axis: Array
    fov: float
    halvings: int = 0
    reach: float = 0.0
    depth: float = 0.0


@dataclass(frozen=True, eq=False)
class Arrivals:
    """Light that arrives at n surfaces from one point of a light each.

    to: unit directions towards it, (n, 3). ends: where shadow rays end, (n, 3). strength: irradiance on planes that
    face it, without shadows, over the light's emission, (n,) or, where colours differ over the light, (n, 3). density:
    of the directions over solid angle, (n,), of a sampled light.
    """

    to: Array
    ends: Array
    strength: Array
    density: Array | None = None


@dataclass(frozen=True, eq=False)
class Meetings:
    """Where n rays meet a light, if nothing lies between.

    distance: (n,), infinite where they miss. radiance: (n, 3), 0 there. density: with which the light's `sample` draws
    these directions, over solid angle, (n,).
    """

    distance: Array
    radiance: Array
    density: Array


@dataclass(frozen=True, eq=False)
class LightSamples:
    """n points that stand for a light together: VPLs of bounce 0, arrays (n, 3).

    They shine as I(w) = emission cos(theta) about their unit normal; or, from infinity, bring the irradiance `emission`
    to planes that face the normal, the direction in which they shine, everywhere.
    """

    position: Array
    normal: Array
    emission: Array


Flux = tuple[Array, Array, Array]
"""Rays that carry light: origins, unit directions, and flux over pi that each carries, (n, 3) each."""
Faults = list[tuple[str, str]]
"""Keys of a light and what is wrong with their values."""


class Light(Protocol):
    """Any light."""

    kind: ClassVar[str]

    @property
    def emission(self) -> Vec3:
        """Factor on all of its light, linear RGB; 0 is off."""

    @property
    def has_area(self) -> bool:
        """Whether it shines from more than one point or direction: shadows are soft, and rays need `places`."""

    @property
    def motion(self) -> Any:
        """How it moves, None at rest."""

    def emit(self, points: Array, places: Array | None, bounds: Bounds) -> Flux:
        """Return rays that together carry its light.

        points: of the unit disc, (n, 2), evenly spread: directions for all lights but those at infinity, whose origins
        they are. places: the other two dimensions, likewise; None for lights without area. A ray that lands on a
        diffuse surface makes a VPL of intensity I(w) = carried * reflectance * cos(theta).
        """

    def measure_flux(self, bounds: Bounds) -> float:
        """Return the luminous flux over pi of its light that may meet the scene."""

    def sample(self, at: Array, places: Array | None, bounds: Bounds) -> Arrivals:
        """Return what arrives at points `at` (n, 3). places: of the unit disc, (n, 2), for lights that have area."""

    def at(self, time: float) -> Light:
        """Return the light where it is at `time` seconds of its motion, at rest there."""

    def translate(self, by: Vec3) -> Light:
        """Return the light moved by a vector, at rest there."""

    def outline(self, bounds: Bounds) -> Array:
        """Return lines that show where it is and which way it shines, (n, 2, 3)."""


class DirectLight(Light, Protocol):
    """A light that shaders evaluate. view_halvings: how often the edge of the map of each of its views is halved."""

    view_halvings: ClassVar[tuple[int, ...]]

    def describe(self) -> Mapping[str, Any]:
        """Return its fields of a LIGHT record (frame/direct_lights.py) but for kind and views."""

    def list_views(self, bounds: Bounds) -> tuple[LightView, ...]:
        """Return what its shadow maps must cover, a map each."""


class SampledLight(Light, Protocol):
    """A light that points stand for."""

    at_infinity: ClassVar[bool]

    def spread(self, square: Array, bounds: Bounds) -> LightSamples:
        """Return points that stand for it together. square: of the unit square, (n, 2), evenly spread."""

    def meet(self, origins: Array, directions: Array) -> Meetings:
        """Return where rays from `origins` (n, 3) in unit `directions` (n, 3) meet it.

        Emitting surfaces, which rays hit themselves, are never met.
        """


def is_direct(light: Any) -> TypeGuard[DirectLight]:
    """Return whether shaders evaluate a light, or a class of lights."""
    return hasattr(light, "describe")


def is_sampled(light: Any) -> TypeGuard[SampledLight]:
    """Return whether points stand for a light."""
    return hasattr(light, "spread")


def aim(source: Array, at: Array) -> tuple[Array, Array]:
    """Return unit directions (n, 3) from points `at` (n, 3) to points `source` (n, 3), and squared distances (n,)."""
    to = source - at
    square = np.maximum(np.einsum("ij,ij->i", to, to), np.finfo(float).tiny)
    to /= np.sqrt(square)[:, None]
    return to, square


def end_outside(at: Array, to: Array, bounds: Bounds) -> Array:
    """Return points (n, 3) outside the scene on the way from points `at` (n, 3) in unit directions `to` (n, 3)."""
    ends: Array = at + to * (4 * bounds.radius)
    return ends


def enter(directions: Array, places: Array, bounds: Bounds) -> Array:
    """Return where rays in unit `directions` (n, 3) enter the scene, (n, 3): outside, on discs that face its middle.

    places: of the unit disc, (n, 2).
    """
    from deferred_ir.sampling.warps import build_basis

    right, up = build_basis(directions)
    across = places[:, :1] * right + places[:, 1:] * up
    origins: Array = np.asarray(bounds.centre) + bounds.radius * (across - 1.5 * directions)
    return origins
