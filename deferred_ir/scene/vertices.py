"""Calculations on vertices and the faces that use them: bounds, transforms, groups, normals."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from deferred_ir.base.arrays import Array, Ints


def find_bounds(points: Array) -> Array:
    """Return the minimum and maximum of points (n, 3), (2, 3)."""
    return np.stack([points.min(axis=0), points.max(axis=0)])


def find_middle(points: Array) -> Array:
    """Return the middle of the box around points (n, 3), (3,); 0 where there are none."""
    return find_bounds(points).mean(axis=0) if len(points) else np.zeros(3)


def transform_points(points: Array, matrix: Array) -> Array:
    """Transform points (n, 3) by a rigid transform (4, 4), float64 (n, 3)."""
    transformed: Array = points @ matrix[:3, :3].T + matrix[:3, 3]
    return transformed


def find_groups(faces: Ints, ranges: Sequence[slice]) -> Ints:
    """Return the group of each of `faces` (F, 3), int (F,): i + 1 where its vertices lie in ranges[i], 0 elsewhere."""
    groups = np.zeros(len(faces), np.intp)
    for number, vertices in enumerate(ranges, start=1):
        groups[(faces[:, 0] >= vertices.start) & (faces[:, 0] < vertices.stop)] = number
    return groups


def find_weights(points: Array, corners: Array) -> Array:
    """Return the barycentric weights of points (n, 3) in the planes of triangles (n, 3, 3), float64 (n, 3)."""
    a, b, c = (corners[:, i] for i in range(3))
    whole = np.cross(b - a, c - a)
    square = np.maximum(np.einsum("ij,ij->i", whole, whole), np.finfo(float).tiny)
    second = np.einsum("ij,ij->i", np.cross(points - a, c - a), whole) / square
    third = np.einsum("ij,ij->i", np.cross(b - a, points - a), whole) / square
    return np.stack([1 - second - third, second, third], axis=1)


def compute_face_areas(positions: Array, faces: Ints) -> Array:
    """Compute the areas of `faces` (F, 3), float64 (F,)."""
    a, b, c = (positions[faces[:, i]] for i in range(3))
    areas: Array = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    return areas


def compute_face_normals(positions: Array, faces: Ints) -> Array:
    """Compute unit normals by winding, float64 (F, 3), of `faces` (F, 3); +y for degenerate ones."""
    a, b, c = (positions[faces[:, i]] for i in range(3))
    # Edges scaled to about 1 first: the product of two tiny edges must not underflow.
    ab, ac = b - a, c - a
    size = np.maximum(np.abs(ab).max(axis=1, initial=0), np.abs(ac).max(axis=1, initial=0))[:, None]
    size[size == 0] = 1
    cross = np.cross(ab / size, ac / size)
    length = np.linalg.norm(cross, axis=1)
    flat = length < 1e-30
    cross[flat], length[flat] = (0, 1, 0), 1
    normals: Array = cross / length[:, None]
    return normals
