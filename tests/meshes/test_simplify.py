"""Simplified meshes keep to their deviation in both directions, whatever the mesh."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from deferred_ir.meshes.simplify import simplify, weld_vertices


def sampled(positions, faces, seed):
    """Sample points all over the triangles, with their corners, (n, 3)."""
    rng = np.random.default_rng(seed)
    weights = rng.dirichlet((0.7, 0.7, 0.7), (len(faces), 8))
    corners = positions[faces]
    return np.concatenate([np.einsum("fsk,fkj->fsj", weights, corners).reshape(-1, 3), corners.reshape(-1, 3)])


def farthest(positions, faces, other, seed):
    """Return the largest distance of sampled points on the first triangles from the second."""
    from trimesh.triangles import closest_point

    points = np.random.default_rng(seed).permutation(sampled(positions, faces, seed))[:100]
    count = len(other)
    nearest = closest_point(np.tile(positions[other], (len(points), 1, 1)), np.repeat(points, count, axis=0))
    return np.linalg.norm(nearest.reshape(-1, count, 3) - points[:, None], axis=2).min(axis=1).max()


def grid(columns, rows, height):
    """A grid of (columns, rows) squares, split in triangles; height(x, y) of each vertex."""
    x, y = (axis.ravel() for axis in np.meshgrid(np.linspace(0, 1, columns + 1), np.linspace(0, 1, rows + 1)))
    at = np.arange(len(x)).reshape(rows + 1, columns + 1)
    a, b, c, d = (at[:-1, :-1].ravel(), at[:-1, 1:].ravel(), at[1:, 1:].ravel(), at[1:, :-1].ravel())
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    return np.stack([x, y, height(x, y)], axis=1), faces


def shape(kind, seed):
    """A mesh (positions, faces) about one unit across."""
    import trimesh

    rng = np.random.default_rng(seed)
    if kind == "terrain":
        steep, fine = rng.uniform(0, 0.3), rng.uniform(2, 9, 2)
        return grid(9, 8, lambda x, y: steep * np.sin(fine[0] * x) * np.cos(fine[1] * y))
    if kind == "folded":
        positions, faces = grid(8, 6, lambda x, y: np.abs(x - 0.5))
        return positions + rng.normal(scale=0.01, size=positions.shape), faces
    if kind == "plate":
        mesh = trimesh.creation.box((1, 0.7, 0.01)).subdivide().subdivide()
    elif kind == "ball":
        mesh = trimesh.creation.icosphere(subdivisions=2, radius=0.5)
    elif kind == "tube":
        mesh = trimesh.creation.annulus(r_min=0.2, r_max=0.25, height=0.8, sections=12).subdivide()
    else:  # soup: no two triangles fit together, some share corners, some are flat or doubled
        positions = rng.uniform(-0.5, 0.5, (30, 3))
        faces = rng.integers(30, size=(60, 3))
        return positions, np.concatenate([faces, faces[:5], np.stack([faces[:5, 0]] * 3, axis=1)])
    return np.array(mesh.vertices), np.array(mesh.faces)


KINDS = ["terrain", "folded", "plate", "ball", "tube", "soup"]


@settings(max_examples=25)
@given(
    kind=st.sampled_from(KINDS),
    seed=st.integers(0, 999),
    deviation=st.floats(1e-4, 0.3),
    scale=st.sampled_from([1e-3, 1.0, 1e3]),
)
@pytest.mark.slow
def test_both_surfaces_keep_to_the_deviation(kind, seed, deviation, scale):
    positions, faces = shape(kind, seed)
    faces = weld_vertices(positions, faces)
    deviations = np.array([deviation / 3, deviation])
    whole = faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)]
    found = simplify(positions * scale, faces, deviations * scale, none(positions))
    # Measured in the mesh's own units: trimesh's nearest points are off by some 0.00005 in smaller ones.
    for most, (left, origin) in zip(deviations, found, strict=True):
        assert 0 < len(left) == len(origin) <= len(whole)
        assert farthest(positions, left, whole, seed) <= most + 1e-9
        assert farthest(positions, whole, left, seed) <= most + 1e-9


def none(positions):
    return np.zeros(len(positions), bool)


@settings(max_examples=20)
@given(kind=st.sampled_from(["plate", "ball", "tube"]), deviation=st.floats(1e-3, 0.3))
def test_what_is_closed_stays_closed(kind, deviation):
    positions, faces = shape(kind, 0)
    left = simplify(positions, faces, [deviation], none(positions))[0][0]
    edges = np.sort(left[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    assert (np.unique(edges, axis=0, return_counts=True)[1] % 2 == 0).all()


def test_flat_and_straight_parts_cost_nothing():
    positions, faces = grid(16, 16, lambda x, y: np.abs(x - 0.5))
    left = simplify(positions, faces, [1e-6], none(positions))[0][0]
    assert len(left) <= 16


def test_a_ball_gets_coarser_with_the_deviation():
    positions, faces = shape("ball", 0)
    counts = [len(left) for left, _ in simplify(positions, faces, [0.003, 0.03, 0.1], none(positions))]
    assert counts == sorted(counts, reverse=True)
    assert counts[-1] < len(faces) / 2


def test_locked_vertices_stay():
    positions, faces = shape("ball", 0)
    locked = positions[:, 2] > 0
    left = simplify(positions, faces, [0.2], locked)[0][0]
    assert set(np.flatnonzero(locked)) <= set(left.ravel())
    assert len(left) < len(faces)


@pytest.mark.parametrize("kind", KINDS)
def test_the_same_mesh_gives_the_same(kind):
    positions, faces = shape(kind, 4)
    first, second = (simplify(positions, faces, [0.01, 0.1], none(positions)) for _ in range(2))
    for one, other in zip(first, second, strict=True):
        np.testing.assert_array_equal(one[0], other[0])
        np.testing.assert_array_equal(one[1], other[1])


@pytest.mark.parametrize("faces", [np.zeros((0, 3), int), [[0, 0, 1]], [[0, 1, 2]], [[0, 1, 2], [0, 1, 2]]])
def test_next_to_nothing(faces):
    """An isolated triangle stays, and one without area goes."""
    positions, faces = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]), np.array(faces)
    left = simplify(positions, faces, [10.0], none(positions))[0][0]
    np.testing.assert_array_equal(left, [face for face in faces.tolist() if len(set(face)) == 3] or np.zeros((0, 3)))


def test_seams_are_welded():
    positions, faces = grid(4, 4, lambda x, y: 0 * x)
    apart, split = positions[faces].reshape(-1, 3), np.arange(3 * len(faces)).reshape(-1, 3)
    together = weld_vertices(apart, split)
    assert len(np.unique(together)) == len(positions)
    np.testing.assert_array_equal(apart[together], apart[split])
