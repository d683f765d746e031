"""Flying: cameras and lights that move and turn as keys and mouse say. Pure geometry, no window."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from deferred_ir.base.arrays import Array, Vec3
from deferred_ir.scene.camera import Camera, view_fault
from deferred_ir.scene.lights.spot import Spotlight

UP: Vec3 = (0.0, 1.0, 0.0)
SIDE: Vec3 = (0.0, 0.0, 1.0)
"""What is up for a light that looks straight up or down."""


def as_camera(light: Spotlight) -> Camera:
    """The light's own view, its cone as high as the picture."""
    up = UP if view_fault(light.position, light.look_at, UP) is None else SIDE
    return Camera(light.position, light.look_at, up, light.fov)


def as_light(light: Spotlight, eye: Camera) -> Spotlight:
    """`light` where `eye` is, and looking where it looks."""
    return replace(light, position=eye.position, look_at=eye.look_at)


def moved(eye: Camera, step: Vec3) -> Camera:
    """`eye` shifted by step = (right, up, forward) along its own axes, world units."""
    by = np.asarray(step) @ eye.axes
    return replace(eye, position=_vec(eye.position + by), look_at=_vec(eye.look_at + by))


def turned(eye: Camera, yaw: float, pitch: float) -> Camera:
    """`eye` turned to the right about its up vector and then upwards, radians; it never turns over."""
    right, _, forward = eye.axes
    up = np.divide(eye.up, np.linalg.norm(eye.up))
    height = math.asin(float(np.clip(forward @ up, -1, 1)))
    pitch = float(np.clip(height + pitch, -1.55, 1.55)) - height
    forward = _rotated(_rotated(forward, right, pitch), up, -yaw)
    reach = float(np.linalg.norm(np.subtract(eye.look_at, eye.position)))
    return replace(eye, look_at=_vec(eye.position + reach * forward))


def _rotated(v: Array, axis: Array, angle: float) -> Array:
    """Rodrigues' formula."""
    turned: Array = (
        v * math.cos(angle) + np.cross(axis, v) * math.sin(angle) + axis * (axis @ v) * (1 - math.cos(angle))
    )
    return turned


def _vec(v: Array) -> Vec3:
    x, y, z = np.asarray(v, dtype=np.float64).tolist()
    return x, y, z
