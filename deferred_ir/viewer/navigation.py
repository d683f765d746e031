"""Flying: cameras and lights that move and turn. Pure geometry, no window."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from deferred_ir.base.arrays import Array, Vec3
from deferred_ir.scene.camera import Camera, find_view_fault
from deferred_ir.scene.lights.base import Light

UP: Vec3 = (0.0, 1.0, 0.0)
SIDE: Vec3 = (0.0, 0.0, 1.0)
"""The up vector for a light whose own lies along its direction."""
STEEPEST = 1.55
"""Radians above or below the horizon, short of straight up or down, where a view would turn over."""


def as_camera(light: Any, fov: float) -> Camera:
    """Return the view from a light that looks somewhere, its cone as high as the picture; fov: without a cone."""
    ups = (getattr(light, "up", UP), SIDE)
    up = next(up for up in ups if find_view_fault(light.position, light.look_at, up) is None)
    return Camera(light.position, light.look_at, up, getattr(light, "fov", fov))


def looks(light: Any) -> bool:
    """Return whether a light shines somewhere, so that one can see from it; None does not."""
    return hasattr(light, "look_at")


def as_light(light: Any, eye: Camera) -> Light:
    """Return `light` at the place of `eye`, looking the same way if it looks anywhere. Raises LightError."""
    place = {"position": eye.position, "look_at": eye.look_at}
    moved: Light = replace(light, **{name: value for name, value in place.items() if hasattr(light, name)})
    return moved


def turn_light(light: Any, yaw: float, pitch: float) -> Light:
    """Turn a light as `turn` does, one that lies all around by its rotation. Raises LightError."""
    if looks(light):
        return as_light(light, turn(as_camera(light, 60.0), yaw, pitch))
    turned: Light = light
    if hasattr(light, "rotation"):
        turned = replace(light, rotation=(light.rotation - math.degrees(yaw) + 180) % 360 - 180)
    return turned


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
