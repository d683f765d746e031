"""The spotlight of docs/conventions.md: I(w) = E cos(theta) cone(theta) [W/sr per channel], theta from its axis."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from deferred_ir.base.arrays import Array, Vec3
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

    def at(self, time: float) -> Spotlight:
        """Return the spotlight where it is at `time` seconds of its motion."""
        if self.motion is None:
            return self
        position, look_at = self.motion.move(self.position, self.look_at, time)
        return replace(self, position=position, look_at=look_at)


def one_minus_cos(fov: float) -> float:
    """1 - cos(fov/2) for a full opening angle in degrees."""
    return 2 * math.sin(math.radians(fov) / 4) ** 2
