"""Triangles that are far larger than what they are near to, cut up before 32 bits hold them.

A float keeps 24 bits. Of a triangle a million times as large as the scene, corners are rounded by a tenth of the scene,
and with them the whole plane. Cut up, the parts in and about the scene have corners as near, and as exact, as the
scene's own. Parts are the larger the farther away they are, so that there are few.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from deferred_ir.base.arrays import Array, Bools, Ints

if TYPE_CHECKING:
    from deferred_ir.scene.geometry import Geometry

LARGEST = 16.0
"""Longest edge of a part, in scales of the scene or, where that is more, in its distances from the scene's middle."""


def graded(geometry: Geometry) -> Geometry:
    """The same surfaces without such triangles; `geometry` itself where there are none. Moving models stay whole."""
    if geometry.diagonal <= LARGEST * geometry.scale:
        return geometry
    still = np.flatnonzero(geometry.groups == 0)
    large = still[_too_large(geometry, geometry.positions[geometry.faces[still]])]
    if len(large) == 0:
        return geometry
    origin, weights = _parts(geometry, large)
    count = len(geometry.positions)

    def longer(values: Array | None) -> Any:
        if values is None:
            return None
        new = np.einsum("nij,njk->nik", weights, values[geometry.faces[origin]].astype(float)).reshape(
            -1, values.shape[1]
        )
        return np.concatenate([values, new.astype(values.dtype)])

    kept = np.delete(np.arange(len(geometry.faces)), large)
    new_faces = count + np.arange(3 * len(origin)).reshape(-1, 3)
    # In the order of the faces they come from, which are sorted by texture.
    order = np.argsort(np.concatenate([kept, origin]), kind="stable")
    return replace(
        geometry,
        positions=longer(geometry.positions),
        faces=np.concatenate([geometry.faces[kept], new_faces])[order].astype(np.int32),
        face_materials=geometry.face_materials[np.concatenate([kept, origin])[order]],
        normals=longer(geometry.normals),
        uvs=longer(geometry.uvs),
        colors=longer(geometry.colors),
        medians=(geometry.middle, geometry.spread),
    )


def _parts(geometry: Geometry, large: Ints) -> tuple[Ints, Array]:
    """Faces (n,) out of `large`, and barycentric coordinates of the corners of a part of each, (n, 3, 3)."""
    origin, weights = large, np.tile(np.eye(3), (len(large), 1, 1))
    done: list[tuple[Ints, Array]] = []
    while len(origin):
        corners = weights @ geometry.positions[geometry.faces[origin]]
        wrong = _too_large(geometry, corners)
        done.append((origin[~wrong], weights[~wrong]))
        origin, weights, corners = origin[wrong], weights[wrong], corners[wrong]
        # Turned so that the longest edge is the first, which is cut in two.
        longest = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2).argmax(axis=1)
        turned = weights[np.arange(len(weights))[:, None], (longest[:, None] + np.arange(3)) % 3]
        a, b, c = turned[:, 0], turned[:, 1], turned[:, 2]
        middle = (a + b) / 2
        weights = np.concatenate([np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)])
        origin = np.concatenate([origin, origin])
    return np.concatenate([rows for rows, _ in done]), np.concatenate([part for _, part in done])


def _too_large(geometry: Geometry, corners: Array) -> Bools:
    """Which of triangles (n, 3, 3) are, (n,)."""
    edges = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2).max(axis=1, initial=0)
    middles = corners.mean(axis=1)
    radius = np.linalg.norm(corners - middles[:, None], axis=2).max(axis=1, initial=0)
    away = np.maximum(np.linalg.norm(middles - geometry.middle, axis=1) - radius, geometry.scale)
    large: Bools = edges > LARGEST * away
    return large
