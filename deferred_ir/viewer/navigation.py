"""Flying: cameras and lights that move and turn. Pure geometry, no window."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from deferred_ir.base.arrays import Array, Vec3
from deferred_ir.scene.camera import Camera, find_view_fault
from deferred_ir.scene.lights.spotlight import Spotlight

UP: Vec3 = (0.0, 1.0, 0.0)
SIDE: Vec3 = (0.0, 0.0, 1.0)
"""The up vector for a light that looks straight up or down."""
STEEPEST = 1.55
"""Radians above or below the horizon, short of straight up or down, where a view would turn over."""


def as_camera(light: Spotlight) -> Camera:
    """Return the view from the light, its cone as high as the picture."""
    up = UP if find_view_fault(light.position, light.look_at, UP) is None else SIDE
    return Camera(light.position, light.look_at, up, light.fov)


def as_light(light: Spotlight, eye: Camera) -> Spotlight:
    """Return `light` at the place of `eye`, looking the same way."""
    return replace(light, position=eye.position, look_at=eye.look_at)


def move(eye: Camera, step: Vec3) -> Camera:
    """Shift `eye` by step = (right, up, forward) along its own axes, world units."""
    by = np.asarray(step) @ eye.axes
    return replace(eye, position=_to_vec3(eye.position + by), look_at=_to_vec3(eye.look_at + by))


def turn(eye: Camera, yaw: float, pitch: float) -> Camera:
    """Turn `eye` to the right about its up vector and then upwards, radians; it never turns over."""
    right, _, forward = eye.axes
    up = np.divide(eye.up, np.linalg.norm(eye.up))
    height = math.asin(float(np.clip(forward @ up, -1, 1)))
    pitch = float(np.clip(height + pitch, -STEEPEST, STEEPEST)) - height
    forward = _rotate(_rotate(forward, right, pitch), up, -yaw)
    reach = float(np.linalg.norm(np.subtract(eye.look_at, eye.position)))
    return replace(eye, look_at=_to_vec3(eye.position + reach * forward))


def _rotate(v: Array, axis: Array, angle: float) -> Array:
    """Rotate v about a unit axis by Rodrigues' formula, radians."""
    rotated: Array = (
        v * math.cos(angle) + np.cross(axis, v) * math.sin(angle) + axis * (axis @ v) * (1 - math.cos(angle))
    )
    return rotated


def _to_vec3(v: Array) -> Vec3:
    x, y, z = np.asarray(v, dtype=np.float64).tolist()
    return x, y, z
