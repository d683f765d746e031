"""Motions of camera, spotlight and models: what `[*.motion]` of a scene file says, evaluated at a time in seconds."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from deferred_ir.base.arrays import Array, Vec3

if TYPE_CHECKING:
    from deferred_ir.scene.camera import Camera
    from deferred_ir.scene.lights.spot import Spotlight

FRAMES_PER_SECOND = 30


def spline(times: tuple[float, ...], points: tuple[Vec3, ...], time: float) -> Vec3:
    """A natural cubic spline through `points` at `times`; it rests at both ends."""
    time = float(np.clip(time, times[0], times[-1]))
    if len(times) == 1:
        return points[0]
    from scipy.interpolate import CubicSpline

    x, y, z = CubicSpline(times, np.asarray(points), bc_type="natural")(time).tolist()
    return x, y, z


@dataclass(frozen=True)
class CameraMotion:
    """Splines through positions and look_ats (world space) at times (seconds, ascending)."""

    times: tuple[float, ...]
    positions: tuple[Vec3, ...]
    look_ats: tuple[Vec3, ...]

    def camera(self, camera: Camera, time: float) -> Camera:
        """`camera`, moved to where it is at `time`."""
        return replace(
            camera,
            position=spline(self.times, self.positions, time),
            look_at=spline(self.times, self.look_ats, time),
        )


@dataclass(frozen=True)
class LissajousMotion:
    """p(t) = position + (ax cos(t w_xz), ay cos(t w_y), az sin(t w_xz)); speed = (w_xz, w_y), rad/s."""

    amplitude: Vec3
    speed: tuple[float, float]

    def spotlight(self, light: Spotlight, time: float) -> Spotlight:
        """`light`, moved to where it is at `time`; it keeps aiming at its look_at."""
        (ax, ay, az), (w_xz, w_y) = self.amplitude, self.speed
        x, y, z = light.position
        moved = (
            x + ax * math.cos(time * w_xz),
            y + ay * math.cos(time * w_y),
            z + az * math.sin(time * w_xz),
        )
        return replace(light, position=moved)


@dataclass(frozen=True)
class KeyframedSpotlight:
    """Splines through positions and look_ats (world space) at times (seconds, ascending)."""

    times: tuple[float, ...]
    positions: tuple[Vec3, ...]
    look_ats: tuple[Vec3, ...]

    def spotlight(self, light: Spotlight, time: float) -> Spotlight:
        """`light`, moved to where it is at `time`."""
        return replace(
            light,
            position=spline(self.times, self.positions, time),
            look_at=spline(self.times, self.look_ats, time),
        )


SpotlightMotion = LissajousMotion | KeyframedSpotlight


@dataclass(frozen=True)
class ModelMotion:
    """Keyframes of a rigid motion: translations and unit quaternions (x, y, z, w) at times (seconds, ascending).

    It turns about the world's origin. origin: where in the world the coordinates begin that it is asked in.
    """

    times: tuple[float, ...]
    translations: tuple[Vec3, ...]
    rotations: tuple[tuple[float, float, float, float], ...]
    origin: Vec3 = field(default=(0.0, 0.0, 0.0), repr=False)

    def seen_from(self, origin: Vec3) -> ModelMotion:
        """The same in coordinates that begin at `origin`."""
        (x, y, z), (u, v, w) = self.origin, origin
        return replace(self, origin=(x + u, y + v, z + w))

    def held(self, time: float) -> ModelMotion:
        """A motion that rests where this one is at `time`."""
        from scipy.spatial.transform import Rotation

        matrix = replace(self, origin=(0.0, 0.0, 0.0)).matrix(time)
        x, y, z = matrix[:3, 3].tolist()
        i, j, k, w = Rotation.from_matrix(matrix[:3, :3]).as_quat().tolist()
        return replace(self, times=(0.0,), translations=((x, y, z),), rotations=((i, j, k, w),))

    def matrix(self, time: float) -> Array:
        """The 4x4 rigid transform at `time`: linear translation, spherical linear rotation; it rests at both ends."""
        from scipy.spatial.transform import Rotation, Slerp

        time = float(np.clip(time, self.times[0], self.times[-1]))
        result = np.eye(4)
        for axis in range(3):
            result[axis, 3] = np.interp(time, self.times, np.asarray(self.translations)[:, axis])
        rotations = Rotation.from_quat(np.asarray(self.rotations))
        result[:3, :3] = (Slerp(self.times, rotations)(time) if len(self.times) > 1 else rotations[0]).as_matrix()
        result[:3, 3] += result[:3, :3] @ self.origin - self.origin
        return result
