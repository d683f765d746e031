"""The camera's axes and rays."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from deferred_ir.scene.camera import Camera
from deferred_ir.scene.motion import CameraMotion

TILTED = Camera((1.0, 2.0, 3.0), (-2.0, 0.5, -1.0), (0.2, 1.0, 0.1), 50.0)
POINTS = st.tuples(*[st.floats(-100, 100)] * 3)


def test_the_axes_of_a_camera_that_looks_along_minus_z():
    np.testing.assert_allclose(Camera((0, 0, 5), (0, 0, 0)).axes, [[1, 0, 0], [0, 1, 0], [0, 0, -1]], atol=1e-15)


@given(POINTS, POINTS, POINTS)
def test_axes_are_orthonormal_and_right_handed(position, look_at, up):
    view = np.subtract(look_at, position)
    if np.linalg.norm(np.cross(view, up)) < 1e-3 * max(1, np.linalg.norm(view) * np.linalg.norm(up)):
        return  # up lies along the view: no camera
    right, upward, forward = axes = Camera(position, look_at, up).axes
    assert axes.dtype == np.float64
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-10)
    np.testing.assert_allclose(np.cross(right, upward), -forward, atol=1e-10)
    np.testing.assert_allclose(forward, view / np.linalg.norm(view), atol=1e-10)
    assert upward @ np.array(up) > 0
    assert abs(right @ np.array(up)) < 1e-9 * np.linalg.norm(up)


@pytest.mark.parametrize("size", [(4, 4), (7, 3), (3, 8), (1, 1)])
def test_rays_go_through_the_pixel_centres_top_row_first(size):
    width, height = size
    rays = TILTED.rays(size)
    assert rays.shape == (height, width, 3)
    right, up, forward = TILTED.axes
    tangent = math.tan(math.radians(TILTED.fov) / 2)
    for row in range(height):
        for column in range(width):
            x = (2 * column + 1 - width) / height * tangent  # square pixels: the height sets the scale
            y = (height - 2 * row - 1) / height * tangent
            np.testing.assert_allclose(rays[row, column], forward + x * right + y * up, atol=1e-14)


def test_the_field_of_view_is_vertical():
    for size in ((10, 10), (1000, 10), (10, 1000)):
        _, b, c = TILTED.ray_axes(size)
        top, bottom = c + b, c - b
        angle = math.degrees(math.acos(top @ bottom / np.linalg.norm(top) / np.linalg.norm(bottom)))
        assert angle == pytest.approx(50)


def test_rays_have_view_depth_1():
    np.testing.assert_allclose(TILTED.rays((5, 3)) @ TILTED.axes[2], 1)


def test_ray_axes_span_the_rays():
    a, b, c = TILTED.ray_axes((2, 2))
    np.testing.assert_allclose(TILTED.rays((2, 2))[0, 1], a * 0.5 + b * 0.5 + c, atol=1e-15)
    np.testing.assert_allclose(TILTED.rays((2, 2))[1, 0], -a * 0.5 - b * 0.5 + c, atol=1e-15)


def test_a_still_camera_is_the_same_at_any_time():
    assert TILTED.at(3.0) is TILTED


def test_a_moving_camera_keeps_what_does_not_move():
    motion = CameraMotion((0.0, 1.0), ((0, 0, 0), (1, 0, 0)), ((0, 0, -1), (1, 0, -1)))
    moved = Camera((9, 9, 9), (0, 0, 0), (0.2, 1, 0), 33.0, motion).at(1.0)
    assert (moved.position, moved.look_at, moved.up, moved.fov) == ((1, 0, 0), (1, 0, -1), (0.2, 1, 0), 33.0)
