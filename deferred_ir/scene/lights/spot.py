"""The light model of docs/conventions.md: one spotlight, the VPLs it makes, and the record in which shaders read both.

The spotlight's intensity is I(w) = E cos(theta) cone(theta) [W/sr per channel], theta from its axis. A VPL shines as
I(w) = E_i cos(theta_y) inside a round cone.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from deferred_ir.base.arrays import Array, Vec3
from deferred_ir.sampling.warps import build_basis
from deferred_ir.scene.motion import SpotlightMotion

LIGHT = np.dtype(
    [
        ("position", "f4", 3),
        ("one_minus_cos", "f4"),  # 1 - cos of the half cone angle, without cancellation
        ("x_axis", "f4", 3),  # right and up, divided by tan(half angle): NDC = dot(d, axis) / dot(d, z)
        ("tan_half", "f4"),
        ("y_axis", "f4", 3),
        ("clamp_squared", "f4"),  # of VPLs: 1/d^2 is taken as 1/max(d^2, this); of the spotlight: radius of its disc
        ("z_axis", "f4", 3),  # unit; where the light looks
        ("tile", "f4"),  # number of its tile in the atlas; the spotlight's (SPOT_TILE) is a whole layer
        ("emission", "f4", 3),
        ("curve", "f4"),  # c / (1 + c), c the cosine of the half cone angle: scales paraboloid maps
    ]
)
"""One light in a std140 uniform block; shaders/lib/lights/light.glsl declares the same five vec4."""

LIGHTS_PER_BLOCK = 192
"""Lights in a uniform block: OpenGL promises 16 KiB (204 lights), and blocks must start at multiples of 256 bytes."""

SPOT_TILE = -1.0


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

    def at(self, time: float) -> Spotlight:
        """Return the spotlight where it is at `time` seconds of its motion."""
        if self.motion is None:
            return self
        position, look_at = self.motion.move(self.position, self.look_at, time)
        return replace(self, position=position, look_at=look_at)


def one_minus_cos(fov: float) -> float:
    """1 - cos(fov/2) for a full opening angle in degrees."""
    return 2 * math.sin(math.radians(fov) / 4) ** 2


def light_records(position: Array, axis: Array, emission: Array, *, fov: float, tile: Array | float) -> np.ndarray:
    """Pack lights with one cone angle `fov` (degrees) into LIGHT records, shape (n,). Inputs are (n, 3), tile (n,)."""
    records = np.zeros(len(position), dtype=LIGHT)
    fill_records(records, position, axis, emission, fov=fov, tile=tile)
    return records


def fill_records(
    records: np.ndarray, position: Array, axis: Array, emission: Array, *, fov: float, tile: Array | float
) -> None:
    """As `light_records`, into zeroed records (n,) that are there."""
    right, up = build_basis(axis)
    half = math.radians(fov) / 2
    tangent, cosine = math.tan(half), math.cos(half)
    records["position"], records["z_axis"], records["emission"] = position, axis, emission
    records["x_axis"], records["y_axis"] = right / tangent, up / tangent
    records["tan_half"], records["one_minus_cos"] = tangent, one_minus_cos(fov)
    records["curve"] = cosine / (1 + cosine)
    records["tile"] = tile


def is_disc(records: np.ndarray) -> bool:
    """Whether the spotlight, the first of the LIGHT records (n,), has a radius."""
    return bool(records["clamp_squared"][0] > 0)
