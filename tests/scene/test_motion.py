"""Motions: the formula, the keys, and rest before the first key and after the last."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from small_scenes import room

from deferred_ir.scene.camera import Camera
from deferred_ir.scene.lights.spotlight import Spotlight
from deferred_ir.scene.motion import CameraMotion, KeyframedLight, LissajousMotion, ModelMotion, evaluate_spline

TIMES = (0.0, 0.5, 2.0, 3.0)
POSITIONS = ((0.0, 0.0, 0.0), (1.0, -1.0, 0.5), (2.0, 0.0, 0.0), (0.0, 4.0, 1.0))
LOOK_ATS = ((5.0, 0.0, 0.0), (5.0, 1.0, 0.0), (5.0, 2.0, 0.0), (5.0, 0.0, 3.0))


@given(st.floats(-100, 100))
def test_the_lissajous_formula(time):
    light = Spotlight((1, 2, 3), (0, -1, 0), motion=LissajousMotion((9, 1, 2.5), (0.6, 0.5)))
    moved = light.at(time)
    expected = (1 + 9 * math.cos(time * 0.6), 2 + math.cos(time * 0.5), 3 + 2.5 * math.sin(time * 0.6))
    assert moved.position == pytest.approx(expected)
    assert moved.look_at == (0, -1, 0)
    np.testing.assert_allclose(moved.axis, np.subtract((0, -1, 0), expected) / math.dist((0, -1, 0), expected))
    assert replace(moved, position=light.position, motion=light.motion) == light


def test_keyframes_hit_the_keys():
    light = Spotlight((7, 7, 7), (0, 0, 0), motion=KeyframedLight(TIMES, POSITIONS, LOOK_ATS))
    camera = Camera((7, 7, 7), (0, 0, 0), motion=CameraMotion(TIMES, POSITIONS, LOOK_ATS))
    for time, position, look_at in zip(TIMES, POSITIONS, LOOK_ATS, strict=True):
        for moved in (light.at(time), camera.at(time)):
            assert moved.position == pytest.approx(position, abs=1e-12)
            assert moved.look_at == pytest.approx(look_at, abs=1e-12)


def test_the_path_is_smooth_between_the_keys():
    """First and second differences stay small across a key: a spline, not a polyline."""
    at = np.array([evaluate_spline(TIMES, POSITIONS, t) for t in (0.5 - 1e-4, 0.5, 0.5 + 1e-4)])
    assert np.abs(np.diff(at, n=2, axis=0)).max() < 1e-6
    assert np.abs(np.diff(at, axis=0)).max() > 1e-5


@pytest.mark.parametrize(("early", "late"), [(-1.0, 3.5), (-1e9, 1e9), (-math.inf, math.inf)])
def test_the_path_rests_outside_its_times(early, late):
    assert evaluate_spline(TIMES, POSITIONS, early) == pytest.approx(POSITIONS[0])
    assert evaluate_spline(TIMES, POSITIONS, late) == pytest.approx(POSITIONS[-1])


def test_one_and_two_keys():
    assert evaluate_spline((4.0,), (POSITIONS[1],), 9.0) == POSITIONS[1]
    assert evaluate_spline((0.0, 2.0), POSITIONS[:2], 1.0) == pytest.approx((0.5, -0.5, 0.25))


def turn(degrees: float) -> tuple[float, float, float, float]:
    """About y."""
    return 0.0, math.sin(math.radians(degrees) / 2), 0.0, math.cos(math.radians(degrees) / 2)


def test_a_model_moves_straight_and_turns_evenly():
    motion = ModelMotion((1.0, 3.0), ((0, 0, 0), (2, 4, -6)), (turn(0), turn(90)))
    for time, share in ((1.0, 0.0), (1.5, 0.25), (2.0, 0.5), (3.0, 1.0), (0.0, 0.0), (9.0, 1.0)):
        matrix = motion.matrix(time)
        np.testing.assert_allclose(matrix[:3, 3], np.multiply(share, (2, 4, -6)), atol=1e-12)
        angle = math.radians(90 * share)
        rotation = [[math.cos(angle), 0, math.sin(angle)], [0, 1, 0], [-math.sin(angle), 0, math.cos(angle)]]
        np.testing.assert_allclose(matrix[:3, :3], rotation, atol=1e-12)
        np.testing.assert_array_equal(matrix[3], [0, 0, 0, 1])


def test_a_model_turns_the_short_way():
    q = turn(60)
    motion = ModelMotion((0.0, 1.0), ((0, 0, 0), (0, 0, 0)), (turn(0), tuple(-part for part in q)))
    np.testing.assert_allclose(motion.matrix(0.5)[0, 0], math.cos(math.radians(30)), atol=1e-12)


@given(st.floats(-1, 4), st.lists(st.tuples(*[st.floats(-1, 1)] * 4), min_size=3, max_size=3))
def test_a_model_stays_rigid(time, quaternions):
    lengths = [math.hypot(*quaternion) for quaternion in quaternions]
    if min(lengths) < 1e-3:
        return
    rotations = tuple(tuple(p / n for p in q) for q, n in zip(quaternions, lengths, strict=True))
    matrix = ModelMotion((0.0, 1.0, 3.0), POSITIONS[:3], rotations).matrix(time)
    np.testing.assert_allclose(matrix[:3, :3] @ matrix[:3, :3].T, np.eye(3), atol=1e-9)
    assert np.linalg.det(matrix[:3, :3]) == pytest.approx(1)


def test_a_model_with_one_key_stands_there():
    np.testing.assert_allclose(ModelMotion((5.0,), ((1, 2, 3),), (turn(90),)).matrix(0.0)[:3, 3], (1, 2, 3))


def test_a_scene_moves_its_camera_and_light_only():
    scene = room()
    assert scene.at(2.0) is scene
    moving = replace(scene, lights=(replace(scene.spotlight, motion=LissajousMotion((0.1, 0, 0.1), (1, 1))),))
    moved = moving.at(1.0)
    assert moved.geometry is scene.geometry
    assert moved.camera == scene.camera
    assert moved.spotlight == replace(moving.spotlight.at(1.0), motion=None)
    assert moved.spotlight.position != moving.spotlight.position
    assert moved.at(2.0) is moved  # a moment stays
    assert moving.hash != scene.hash
