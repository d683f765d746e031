"""Motions of camera, spotlight and models (the `motion` tables of a scene file), evaluated at a time in seconds."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from deferred_ir.base.arrays import Array, Vec3

FRAMES_PER_SECOND = 30


def evaluate_spline(times: tuple[float, ...], points: tuple[Vec3, ...], time: float) -> Vec3:
    """Evaluate the natural cubic spline through `points` at `times`; before and after them it stays at the ends."""
    time = float(np.clip(time, times[0], times[-1]))
    if len(times) == 1:
        return points[0]
    from scipy.interpolate import CubicSpline

    x, y, z = CubicSpline(times, np.asarray(points), bc_type="natural")(time).tolist()
    return x, y, z


@dataclass(frozen=True)
class ViewKeyframes:
    """Splines through positions and look_ats (world space) at times (seconds, ascending)."""

    times: tuple[float, ...]
    positions: tuple[Vec3, ...]
    look_ats: tuple[Vec3, ...]

    def move(self, position: Vec3, look_at: Vec3, time: float) -> tuple[Vec3, Vec3]:
        """Return position and look_at at `time`; those of the view at rest do not matter."""
        del position, look_at
        return evaluate_spline(self.times, self.positions, time), evaluate_spline(self.times, self.look_ats, time)


class CameraMotion(ViewKeyframes):
    """Keyframes of a camera."""


@dataclass(frozen=True)
class KeyframedLight(ViewKeyframes):
    """Keyframes of a light. Without look_ats, what it looks at stays; lights that shine all around have none."""

    look_ats: tuple[Vec3, ...] = ()

    def move(self, position: Vec3, look_at: Vec3, time: float) -> tuple[Vec3, Vec3]:
        """Return position and look_at at `time`, from those of the light at rest."""
        if self.look_ats:
            return super().move(position, look_at, time)
        return evaluate_spline(self.times, self.positions, time), look_at


@dataclass(frozen=True)
class LissajousMotion:
    """p(t) = position + (ax cos(t w_xz), ay cos(t w_y), az sin(t w_xz)); speed = (w_xz, w_y), rad/s."""

    amplitude: Vec3
    speed: tuple[float, float]

    def move(self, position: Vec3, look_at: Vec3, time: float) -> tuple[Vec3, Vec3]:
        """Return position and look_at at `time`, from the position at rest; look_at stays."""
        (ax, ay, az), (w_xz, w_y) = self.amplitude, self.speed
        x, y, z = position
        moved = (
            x + ax * math.cos(time * w_xz),
            y + ay * math.cos(time * w_y),
            z + az * math.sin(time * w_xz),
        )
        return moved, look_at


LightMotion = LissajousMotion | KeyframedLight


@dataclass(frozen=True)
class ModelMotion:
    """Keyframes of a rigid motion: translations and unit quaternions (x, y, z, w) at times (seconds, ascending).

    Rotations are about the world's origin. origin: the world position of the origin of the coordinates that `matrix`
    transforms.
    """

    times: tuple[float, ...]
    translations: tuple[Vec3, ...]
    rotations: tuple[tuple[float, float, float, float], ...]
    origin: Vec3 = field(default=(0.0, 0.0, 0.0), repr=False)

    def shift_origin(self, origin: Vec3) -> ModelMotion:
        """Return the same motion in coordinates whose origin lies at `origin` in the present ones."""
        (x, y, z), (u, v, w) = self.origin, origin
        return replace(self, origin=(x + u, y + v, z + w))

    def freeze(self, time: float) -> ModelMotion:
        """Return a motion that stays where this one is at `time`."""
        from scipy.spatial.transform import Rotation

        matrix = replace(self, origin=(0.0, 0.0, 0.0)).matrix(time)
        x, y, z = matrix[:3, 3].tolist()
        i, j, k, w = Rotation.from_matrix(matrix[:3, :3]).as_quat().tolist()
        return replace(self, times=(0.0,), translations=((x, y, z),), rotations=((i, j, k, w),))

    def matrix(self, time: float) -> Array:
        """Return the 4x4 rigid transform at `time`; before and after the keyframes it stays at the ends.

        Translations are interpolated linearly, rotations spherically.
        """
        from scipy.spatial.transform import Rotation, Slerp

        time = float(np.clip(time, self.times[0], self.times[-1]))
        result = np.eye(4)
        for axis in range(3):
            result[axis, 3] = np.interp(time, self.times, np.asarray(self.translations)[:, axis])
        rotations = Rotation.from_quat(np.asarray(self.rotations))
        result[:3, :3] = (Slerp(self.times, rotations)(time) if len(self.times) > 1 else rotations[0]).as_matrix()
        result[:3, 3] += result[:3, :3] @ self.origin - self.origin
        return result
