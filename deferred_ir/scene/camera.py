"""The pinhole camera: its place, and the vectors that shaders and ray tracers need.

Conventions (docs/conventions.md): right-handed world, the camera looks along its -z, +x is right, +y is up.
Pixel (0, 0) is the top left one of an image; its centre lies half a pixel inside.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from pyglm import glm

from deferred_ir.base.arrays import Array, Vec3, add_vec3
from deferred_ir.scene.motion import CameraMotion


def find_view_fault(position: Vec3, look_at: Vec3, up: Vec3 | None = None) -> tuple[str, str] | None:
    """Return the key at fault and why, if a view has no direction or `up` lies along it, else None."""
    view = np.subtract(look_at, position)
    length = math.hypot(*view)
    if length <= 1e-9 * max(map(abs, (*position, *look_at))):
        return "look_at", "is the same point as the position; move one of them"
    if up is None:
        return None
    up_length = math.hypot(*up)
    if up_length == 0:
        return "up", "must not be zero; [0, 1, 0] is the usual one"
    if np.linalg.norm(np.cross(view / length, np.divide(up, up_length))) < 1e-6:
        return "up", "up lies along the direction of view; turn it to the side"
    return None


@dataclass(frozen=True)
class Camera:
    """A pinhole camera. position, look_at, up: world space; fov: vertical opening angle in degrees."""

    position: Vec3
    look_at: Vec3
    up: Vec3 = (0.0, 1.0, 0.0)
    fov: float = 60.0
    motion: CameraMotion | None = None

    @cached_property
    def axes(self) -> Array:
        """Right, up and forward, orthonormal rows, float64 (3, 3)."""
        # Three numbers each: given one tuple, PyGLM reads it in single precision.
        view = glm.lookAt(glm.dvec3(*self.position), glm.dvec3(*self.look_at), glm.dvec3(*self.up))
        rows = np.array(view, dtype=np.float64)[:3, :3]  # GLM's rows of the view matrix: right, up, backward
        axes: Array = rows * np.array([[1.0], [1.0], [-1.0]])
        return axes

    def ray_axes(self, size: tuple[int, int]) -> Array:
        """Return rows a, b, c, float64 (3, 3): position + a*x + b*y + c is the point at view depth 1 behind NDC (x, y).

        `size` is (width, height) in pixels.
        """
        width, height = size
        tangent = np.tan(np.radians(self.fov) / 2)
        axes: Array = self.axes * np.array([[tangent * width / height], [tangent], [1.0]])
        return axes

    def rays(self, size: tuple[int, int]) -> Array:
        """Return directions through all pixel centres at view depth 1 (not unit), float64 (H, W, 3), top row first."""
        width, height = size
        a, b, c = self.ray_axes(size)
        x = (np.arange(width) + 0.5) / width * 2 - 1
        y = 1 - (np.arange(height) + 0.5) / height * 2
        directions: Array = x[None, :, None] * a + y[:, None, None] * b + c
        return directions

    def at(self, time: float) -> Camera:
        """Return the camera where it is at `time` seconds of its motion."""
        if self.motion is None:
            return self
        position, look_at = self.motion.move(self.position, self.look_at, time)
        return replace(self, position=position, look_at=look_at)

    def translate(self, by: Vec3) -> Camera:
        """Return the camera moved by a vector, at rest there."""
        position, look_at = add_vec3(self.position, by), add_vec3(self.look_at, by)
        return replace(self, position=position, look_at=look_at, motion=None)
