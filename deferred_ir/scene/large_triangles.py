"""Splits triangles that are far larger than the scene around them, before 32-bit floats hold them.

A float keeps 24 bits. The corners of a triangle a million times as large as the scene are rounded by a tenth of the
scene, and the whole plane with them. After splitting, the pieces in and near the scene have corners as close, and so as
exact, as the scene's own. Pieces grow with their distance, so that there are few.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from deferred_ir.base.arrays import Array, Bools, Ints
from deferred_ir.scene.geometry import Geometry

LARGEST = 16.0
"""Longest edge of a piece, in scales of the scene or, where that is more, in distances from the scene's middle."""


def split_large_triangles(geometry: Geometry) -> Geometry:
    """Return the same surfaces without huge triangles; itself where there are none. Moving models stay whole."""
    if geometry.diagonal <= LARGEST * geometry.scale:
        return geometry
    static = np.flatnonzero(geometry.groups == 0)
    large = static[_is_too_large(geometry, geometry.positions[geometry.faces[static]])]
    if len(large) == 0:
        return geometry
    origin, weights = _split(geometry, large)
    count = len(geometry.positions)

    def extend(values: Array | None) -> Any:
        if values is None:
            return None
        new = np.einsum("nij,njk->nik", weights, values[geometry.faces[origin]].astype(float)).reshape(
            -1, values.shape[1]
        )
        return np.concatenate([values, new.astype(values.dtype)])

    small = np.delete(np.arange(len(geometry.faces)), large)
    new_faces = count + np.arange(3 * len(origin)).reshape(-1, 3)
    # In the order of the faces they come from, which are sorted by texture.
    order = np.argsort(np.concatenate([small, origin]), kind="stable")
    return replace(
        geometry,
        positions=extend(geometry.positions),
        faces=np.concatenate([geometry.faces[small], new_faces])[order].astype(np.int32),
        face_materials=geometry.face_materials[np.concatenate([small, origin])[order]],
        normals=extend(geometry.normals),
        uvs=extend(geometry.uvs),
        colors=extend(geometry.colors),
        second_uvs=extend(geometry.second_uvs),
        tangents=extend(geometry.tangents),
        medians=(geometry.middle, geometry.spread),
    )


def _split(geometry: Geometry, large: Ints) -> tuple[Ints, Array]:
    """Split the faces `large` (m,).

    Returns for each piece the face it comes from, (n,), and the barycentric coordinates of its corners, (n, 3, 3).
    """
    origin, weights = large, np.tile(np.eye(3), (len(large), 1, 1))
    done: list[tuple[Ints, Array]] = []
    while len(origin):
        corners = weights @ geometry.positions[geometry.faces[origin]]
        too_large = _is_too_large(geometry, corners)
        done.append((origin[~too_large], weights[~too_large]))
        origin, weights, corners = origin[too_large], weights[too_large], corners[too_large]
        # Rotate the corners so that the longest edge comes first, and halve it.
        longest = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2).argmax(axis=1)
        rotated = weights[np.arange(len(weights))[:, None], (longest[:, None] + np.arange(3)) % 3]
        a, b, c = rotated[:, 0], rotated[:, 1], rotated[:, 2]
        middle = (a + b) / 2
        weights = np.concatenate([np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)])
        origin = np.concatenate([origin, origin])
    return np.concatenate([rows for rows, _ in done]), np.concatenate([pieces for _, pieces in done])


def _is_too_large(geometry: Geometry, corners: Array) -> Bools:
    """Return which of triangles (n, 3, 3) are too large for their place, bool (n,)."""
    edges = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2).max(axis=1, initial=0)
    middles = corners.mean(axis=1)
    radius = np.linalg.norm(corners - middles[:, None], axis=2).max(axis=1, initial=0)
    away = np.maximum(np.linalg.norm(middles - geometry.middle, axis=1) - radius, geometry.scale)
    large: Bools = edges > LARGEST * away
    return large
