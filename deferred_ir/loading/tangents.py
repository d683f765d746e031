"""Tangents for normal maps: those of a file, placed in the world, or computed from texture coordinates.

glTF leaves computing to MikkTSpace (Mikkelsen 2008). Here, as there, a vertex has the mean of its faces' tangents in
the plane of its normal, weighed by angles, and one for each orientation of the texture; vertices that differ in their
numbers alone count as one. Unlike there, faces need not share an edge to share a tangent.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from deferred_ir.base.arrays import Array, Ints
from deferred_ir.loading.model_data import Part
from deferred_ir.scene.vertices import compute_face_normals

LEAST_AREA = 1e-12
"""Faces whose area on the texture is less than this, in squares of their size there, tell no direction."""
LEAST_SINE = 1e-6
"""Least sine of the angle between a normal and a direction along the surface."""


def place_tangents(tangents: Array, normals: Array, linear: Array) -> Array:
    """Return a file's tangents (n, 4) under the map `linear` (3, 3), unit and at right angles to `normals` (n, 3).

    normals: as placed. What is no tangent becomes a zero row.
    """
    along = np.where(np.isfinite(tangents[:, :3]).all(axis=1, keepdims=True), tangents[:, :3], 0.0) @ linear.T
    sides = np.where(tangents[:, 3] < 0, -1.0, 1.0) * (-1.0 if np.linalg.det(linear) < 0 else 1.0)
    return _combine(_flatten(along, normals), sides)


def add_tangents(part: Part) -> Part:
    """Return a part whose material has a normal map with tangents; vertices may become several.

    Faces without normals of their own get vertices of their own, since they are flat.
    """
    texture = part.material.normal_texture
    assert texture is not None
    if part.normals is None:
        part = part.pick(part.faces.ravel(), np.arange(part.faces.size).reshape(-1, 3))
    uvs = (part.uvs, part.second_uvs)[texture.uv_set]
    assert uvs is not None
    read_at = uvs @ np.reshape(texture.transform, (2, 3))[:, :2].T
    along, sides = _find_face_tangents(part.positions[part.faces], read_at[part.faces])
    flat = np.repeat(compute_face_normals(part.positions, part.faces), 3, axis=0)
    normals = flat if part.normals is None else part.normals[part.faces.ravel()]
    # The side of the texture that a corner shows to where its normal points.
    mirrored = np.repeat(sides < 0, 3) != ((normals * flat).sum(axis=1) < 0)
    vertices, corners = np.unique(part.faces.ravel() * 2 + mirrored, return_inverse=True)
    split = part.pick(vertices // 2, corners.reshape(part.faces.shape))
    weighted = _flatten(np.repeat(along, 3, axis=0), normals) * _find_angles(split).reshape(-1, 1)
    alike = _find_alike(split, read_at[vertices // 2], vertices % 2)
    sums: Array = np.stack([np.bincount(alike[corners], weighted[:, axis], len(vertices)) for axis in range(3)], axis=1)
    return replace(split, tangents=_combine(_normalize(sums)[alike], np.where(vertices % 2, -1.0, 1.0)))


def _find_face_tangents(positions: Array, uvs: Array) -> tuple[Array, Array]:
    """Return the unit directions of u in faces (f, 3), zero where the texture is not spread out, and 1 or -1, (f,).

    positions (f, 3, 3), uvs (f, 3, 2). The sign is -1 where faces show the texture mirrored.
    """
    (first, second), (a, b) = ([array[:, i] - array[:, 0] for i in (1, 2)] for array in (positions, uvs))
    area = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    sides = np.where(area < 0, -1.0, 1.0)
    along = (first * b[:, 1:] - second * a[:, 1:]) * sides[:, None]
    size = np.maximum(np.abs(a).max(axis=1), np.abs(b).max(axis=1))
    return _normalize(np.where((np.abs(area) > LEAST_AREA * size**2)[:, None], along, 0.0)), sides


def _find_angles(part: Part) -> Array:
    """Return the angles of faces at their corners (f, 3)."""
    corners = part.positions[part.faces]
    angles = []
    for i in range(3):
        one, other = (_normalize(corners[:, (i + step) % 3] - corners[:, i]) for step in (1, 2))
        angles.append(np.arccos(np.clip((one * other).sum(axis=1), -1, 1)))
    return np.stack(angles, axis=1)


def _find_alike(part: Part, uvs: Array, sides: Ints) -> Ints:
    """Return for each vertex the first one with the same position, normal and texture coordinates, on the same side."""
    if part.normals is None:
        return np.arange(len(part.positions))
    rows = np.concatenate([part.positions, part.normals, uvs, sides[:, None]], axis=1) + 0.0  # of -0 it makes 0
    keys = np.ascontiguousarray(rows).view(f"V{rows.dtype.itemsize * rows.shape[1]}").ravel()
    _, first, which = np.unique(keys, return_index=True, return_inverse=True)
    alike: Ints = first[which]
    return alike


def _flatten(along: Array, normals: Array) -> Array:
    """Return the parts of vectors (n, 3) at right angles to unit normals (n, 3), unit; zero where there is none."""
    unit = _normalize(along)
    flat = unit - normals * (unit * normals).sum(axis=1, keepdims=True)
    return _normalize(np.where(np.linalg.norm(flat, axis=1, keepdims=True) > LEAST_SINE, flat, 0.0))


def _combine(along: Array, sides: Array) -> Array:
    """Return tangents (n, 4) of directions (n, 3) and signs (n,); rows of zeros stay."""
    return np.concatenate([along, (sides * along.any(axis=1))[:, None]], axis=1)


def _normalize(rows: Array) -> Array:
    """Divide rows (n, 3) by their lengths; those that are zero, or all but zero, become zero."""
    size = np.abs(rows).max(axis=1, keepdims=True)
    scaled = np.divide(rows, size, out=np.zeros_like(rows), where=size > 1e-150)
    length = np.linalg.norm(scaled, axis=1, keepdims=True)
    unit: Array = np.divide(scaled, length, out=np.zeros_like(rows), where=length > 0)
    return unit
