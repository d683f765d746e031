"""Maps of sample points: the disc keeps areas, bases are orthonormal."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from deferred_ir.sampling.patterns import sample_unit_square
from deferred_ir.sampling.warps import build_basis, square_to_disc

COORDINATE = st.floats(-1, 1)


def normalise(*vector: float) -> np.ndarray:
    return np.array(vector) / np.linalg.norm(vector)


def test_the_disc_is_filled_evenly():
    points = square_to_disc(sample_unit_square("random", 1_000_000, 0))
    radius, angle = np.hypot(*points.T), np.arctan2(points[:, 1], points[:, 0])
    assert radius.max() <= 1
    assert radius.mean() == pytest.approx(2 / 3, rel=1e-3)
    np.testing.assert_allclose(points.mean(axis=0), 0, atol=2e-3)
    rings, _ = np.histogram(radius**2, bins=20, range=(0, 1))  # rings of equal area, the innermost included
    np.testing.assert_allclose(rings / rings.mean(), 1, atol=0.02)
    sectors, _ = np.histogram(angle, bins=24, range=(-np.pi, np.pi))
    np.testing.assert_allclose(sectors / sectors.mean(), 1, atol=0.02)


@given(st.floats(0.001, 0.999), st.floats(0.001, 0.999))
def test_the_disc_map_preserves_area_everywhere(u, v):
    """Its Jacobian is pi; differences taken on one side of the diagonals, where it has a kink."""
    h = 1e-6
    near_kink = abs(u - v) < 4 * h or abs(u + v - 1) < 4 * h
    if near_kink:
        return
    p = square_to_disc(np.array([[u - h, v], [u + h, v], [u, v - h], [u, v + h]]))
    du, dv = (p[1] - p[0]) / (2 * h), (p[3] - p[2]) / (2 * h)
    assert abs(du[0] * dv[1] - du[1] * dv[0]) == pytest.approx(np.pi, rel=1e-4)


def test_the_centre_and_the_corners_of_the_square():
    points = square_to_disc(
        np.array([[0.5, 0.5], [0, 0.5], [0.5, 0], [1, 0.5], [0.5, 1], [0, 0], [1, 1], [1, 0], [0, 1]])
    )
    assert np.isfinite(points).all()
    np.testing.assert_allclose(points[:5], [[0, 0], [-1, 0], [0, -1], [1, 0], [0, 1]], atol=1e-15)
    np.testing.assert_allclose(np.hypot(*points[5:].T), 1)


@given(st.tuples(st.floats(0, 1), st.floats(0, 1)))
def test_neighbours_stay_neighbours(point):
    step = np.array([[0, 0], [1e-5, 0], [0, 1e-5]])
    p = square_to_disc(np.clip(np.array(point) * (1 - 1e-5) + step, 0, 1))
    assert np.linalg.norm(p[1:] - p[0], axis=1).max() < 5e-5


@given(st.tuples(COORDINATE, COORDINATE, COORDINATE).filter(lambda v: math.hypot(*v) > 1e-3))
def test_bases_are_orthonormal_and_right_handed(vector):
    assert_basis(normalise(*vector))


@pytest.mark.parametrize(
    "axis",
    [(0, 0, 1), (0, 0, -1), (1, 0, 0), (-1, 0, 0), (0, 1, 0), (1, 0, -0.0), (1e-9, 0, -1), (1e-20, 0, -1)],
)
def test_bases_hold_at_the_poles(axis):
    assert_basis(normalise(*axis))


def assert_basis(axis: np.ndarray) -> None:
    right, up = build_basis(axis)
    rows = np.stack([right, up, axis])
    np.testing.assert_allclose(rows @ rows.T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(np.cross(right, up), axis, atol=1e-12)


def test_bases_of_many_axes_are_those_of_each():
    axes = np.random.default_rng(1).normal(size=(5, 4, 3))
    axes /= np.linalg.norm(axes, axis=-1, keepdims=True)
    right, up = build_basis(axes)
    assert right.shape == up.shape == (5, 4, 3)
    np.testing.assert_array_equal(right[2, 3], build_basis(axes[2, 3])[0])
