"""The light model's formulas in double precision, and the records that shaders read."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from deferred_ir.sampling.warps import build_basis
from deferred_ir.scene.lights.spotlight import Spotlight, one_minus_cos

COORDINATE = st.floats(-1, 1)


def unit(*vector: float) -> np.ndarray:
    return np.array(vector) / np.linalg.norm(vector)


@pytest.mark.parametrize("fov", [0.1, 1.0, 40.0, 80.0, 150.0, 179.0])
def test_the_cone_is_the_naive_formula(fov):
    light = Spotlight((0, 0, 0), (1, 2, -3), fov)
    half = math.radians(fov) / 2
    right, _ = build_basis(light.axis)
    theta = half * np.linspace(0, 1.5, 301)
    theta = theta[theta < math.pi]
    directions = np.cos(theta)[:, None] * light.axis + np.sin(theta)[:, None] * right
    naive = np.clip(4 * (np.cos(theta) - math.cos(half)) / (1 - math.cos(half)), 0, 1)
    # The naive formula itself loses 1e-16 / (1 - cos): 3e-10 at 0.1 degrees.
    np.testing.assert_allclose(light.cone(directions), naive, atol=1e-14 / (1 - math.cos(half)) + 1e-12)


@pytest.mark.parametrize("fov", [0.1, 0.001])
def test_the_cone_is_stable_where_cosines_cancel(fov):
    """For a narrow cone 1 - cos is theta^2/2, so the factor is 4 (1 - (theta/half)^2) to 1e-6 and better."""
    light = Spotlight((0, 0, 0), (1, 2, -3), fov)
    half = math.radians(fov) / 2
    right, _ = build_basis(light.axis)
    fraction = np.linspace(0, 1.2, 200)
    directions = np.cos(fraction * half)[:, None] * light.axis + np.sin(fraction * half)[:, None] * right
    np.testing.assert_allclose(light.cone(directions), np.clip(4 * (1 - fraction**2), 0, 1), atol=2e-6)


def test_the_cone_is_1_inside_0_outside_and_keeps_shape():
    light = Spotlight((0, 1, 0), (0, 0, 0), 90.0)
    directions = np.array([[[0, -1, 0], [0, 1, 0]], [[1, 0, 0], unit(1, -1.001, 0)]])
    np.testing.assert_allclose(light.cone(directions), [[1, 0], [0, 0]], atol=0.01)


@given(st.floats(1e-4, 179.99))
def test_one_minus_cos_is_precise(fov):
    half = np.longdouble(fov) * np.longdouble(np.pi) / 360
    assert one_minus_cos(fov) == pytest.approx(float(2 * np.sin(half / 2) ** 2), rel=1e-12)


def test_the_axis_is_a_unit_vector_towards_look_at():
    np.testing.assert_allclose(Spotlight((1, 2, 3), (1, 2, -7)).axis, (0, 0, -1))
    np.testing.assert_allclose(Spotlight((0, 0, 0), (3e10, 0, 4e10)).axis, (0.6, 0, 0.8))
