"""Splits triangles until no edge is longer than a bound. No OpenGL.

Whether an edge is halved depends on its two ends alone, so triangles that share an edge, even with vertices of their
own, split it alike, and no crack opens. (`trimesh.remesh.subdivide_to_size` splits all three edges of a triangle if one
is too long, whatever its neighbour does.)
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from deferred_ir.base.arrays import Array, Bools, Ints
from deferred_ir.base.errors import GraphError
from deferred_ir.meshes.posed import MapMesh
from deferred_ir.scene.vertices import find_middle

MOST = 2_000_000
"""Most triangles; more are refused before they are made."""


def subdivide(positions: Array, faces: Ints, longest: float, most: int = MOST) -> tuple[Array, Ints]:
    """Split the surface so that no edge is longer than `longest`: positions (V', 3), float64, and faces (F', 3).

    positions: (V, 3), rounded to float32; vertices at the same place become one. faces: (F, 3); pieces keep the
    winding. Raises GraphError if there would be more than `most` triangles.
    """
    points, index = np.unique(positions.astype(np.float32), axis=0, return_inverse=True)
    # Middles in double precision: far from the origin, halves of a short edge would meet one of its ends.
    points = points.astype(np.float64)
    ahead: Ints = index.reshape(-1)[faces].astype(np.int64)
    done, known = [ahead[:0]], 0
    while len(ahead):
        long = _lengths(points, ahead) > longest
        split = long.any(axis=1)
        done.append(ahead[~split])
        ahead, long, known = ahead[split], long[split], known + len(done[-1])
        if known + len(ahead) + long.sum() > most:
            raise GraphError(
                f"shadow_maps.edge: no edge over {longest:g} takes more than {most:,} triangles, the limit; use a "
                "larger one, or shadow_maps.tessellation = 'adaptive'"
            )
        points, middles = _halve(points, ahead, long)
        ahead = _split_faces(points, ahead, middles, long)
    return points, np.concatenate(done)


def subdivide_mesh(mesh: MapMesh, longest: float) -> MapMesh:
    """Subdivide a mesh, each moving model on its own, so that models never share a vertex."""
    parts = [subdivide(mesh.positions, mesh.faces[mesh.groups == 0], longest)]
    for number, vertices in enumerate(mesh.moving, start=1):
        own, faces = mesh.positions[vertices], mesh.faces[mesh.groups == number] - vertices.start
        points, faces = subdivide(own - find_middle(own), faces, longest)
        parts.append((points + find_middle(own), faces))
    starts = np.cumsum([0, *(len(points) for points, _ in parts)]).tolist()
    return MapMesh(
        np.concatenate([points for points, _ in parts]),
        np.concatenate([faces + start for (_, faces), start in zip(parts, starts, strict=False)]),
        tuple(slice(start, stop) for start, stop in pairwise(starts[1:])),
    )


def _lengths(points: Array, faces: Ints) -> Array:
    """Return the length of edge i of each face, from corner i to the next, (F, 3): the same bits from both ends."""
    corners = points[faces]
    lengths: Array = np.sqrt(((np.roll(corners, -1, axis=1) - corners) ** 2).sum(axis=2))
    return lengths


def _halve(points: Array, faces: Ints, long: Bools) -> tuple[Array, Ints]:
    """Append the middles of the edges `long` (F, 3) to the points. Returns these and the middles' indices, (F, 3)."""
    ends = np.stack([faces, np.roll(faces, -1, axis=1)], axis=2)[long]
    keys, number = np.unique(ends.min(axis=1) * len(points) + ends.max(axis=1), return_inverse=True)
    one, other = points[keys // len(points)], points[keys % len(points)]
    middles = np.zeros_like(faces)
    middles[long] = len(points) + number.reshape(-1)
    return np.concatenate([points, one / 2 + other / 2]), middles


def _split_faces(points: Array, faces: Ints, middles: Ints, long: Bools) -> Ints:
    """Split each face between the middles of its edges that are `long` (F, 3), into two, three or four."""
    count = long.sum(axis=1)
    # Rotate the corners so that the first edge is long, and the second if two are.
    turn = np.where(count == 1, long.argmax(axis=1), np.where(count == 2, (long.argmin(axis=1) + 1) % 3, 0))
    rotated = (np.arange(3) + turn[:, None]) % 3
    a, b, c = np.take_along_axis(faces, rotated, axis=1).T
    ab, bc, ca = np.take_along_axis(middles, rotated, axis=1).T
    one, two, three = count == 1, count == 2, count == 3
    # With two long edges, the quadrilateral beyond the corner between them is split along its shorter diagonal.
    shorter = np.linalg.norm(points[bc] - points[a], axis=1) < np.linalg.norm(points[ab] - points[c], axis=1)
    parts = [
        (one, (a, ab, c), (ab, b, c)),
        (two, (ab, b, bc)),
        (two & shorter, (a, ab, bc), (a, bc, c)),
        (two & ~shorter, (a, ab, c), (ab, bc, c)),
        (three, (a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)),
    ]
    return np.concatenate([np.stack(part, axis=1)[chosen] for chosen, *found in parts for part in found])
