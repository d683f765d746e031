"""Rays through what is cut out of surfaces: Embree finds the triangles, alpha says whether anything is there."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from deferred_ir.base.arrays import Array, Bools, Ints
from deferred_ir.rays.embree import INFINITE, EmbreeScenes
from deferred_ir.scene.geometry import Geometry
from deferred_ir.scene.scene import Scene
from deferred_ir.scene.surfaces.points import SurfacePoints

ONWARD = 1e-5
"""How far behind a hole a ray goes on, in its distance so far and in the scene's scale."""
MOST_HOLES = 256
"""Most holes that a ray goes through; what it meets then is taken to be there."""


class CutOutRays:
    """Rays of an EmbreeScenes that go on through holes. find_scene: returns the scene whose materials count."""

    def __init__(self, rays: EmbreeScenes, find_scene: Callable[[], Scene]) -> None:
        self._rays, self._find_scene = rays, find_scene

    def pose(self, geometry: Geometry) -> None:
        """Move the moving models to another pose of the same geometry."""
        self._rays.pose(geometry)

    def closest(self, origins: Array, ways: Array, reach: Array | None = None) -> tuple[Ints, Array, Array]:
        """Return the first faces hit where something is there, and u and v, as EmbreeScenes.closest does."""
        ends = np.full(len(origins), INFINITE, np.float32) if reach is None else reach
        first = self._rays.closest(origins, ways, ends)
        face, u, v = first[0].copy(), first[1].copy(), first[2].copy()
        rows = np.flatnonzero(self._is_hole(face, u, v))
        starts, left = origins[rows], ends[rows]
        for _ in range(MOST_HOLES):
            if not len(rows):
                break
            step = self._step(starts, ways[rows], face[rows], u[rows], v[rows])
            starts = (starts + step[:, None] * ways[rows]).astype(np.float32)
            left = (left - step).astype(np.float32)
            ended = left <= 0
            found = self._rays.closest(starts, ways[rows], np.maximum(left, 0))
            face[rows], u[rows], v[rows] = found
            face[rows[ended]] = -1
            on = self._is_hole(face[rows], u[rows], v[rows])
            rows, starts, left = rows[on], starts[on], left[on]
        return face, u, v

    def occluded(self, origins: Array, ways: Array, reach: Array) -> Bools:
        """Return whether rays hit anything that is there within `reach` (n,) lengths of their directions, bool (n,)."""
        hidden: Bools = self._rays.occluded(origins, ways, reach)
        rows = np.flatnonzero(hidden)
        face, _, _ = self.closest(origins[rows], ways[rows], reach[rows])
        hidden[rows] = face >= 0
        return hidden

    def _is_hole(self, face: Ints, u: Array, v: Array) -> Bools:
        """Return which hits (n,) are on parts of surfaces that are not there, bool (n,)."""
        scene = self._find_scene()
        geometry, materials = scene.geometry, scene.materials
        cutoffs = np.array([-1.0 if m.alpha_cutoff is None else m.alpha_cutoff for m in materials])
        holes = np.zeros(len(face), bool)
        hit = np.flatnonzero(face >= 0)
        rows = hit[cutoffs[geometry.face_materials[face[hit]]] > 0]
        if len(rows):
            a, b = u[rows].astype(np.float64), v[rows].astype(np.float64)
            weights = np.stack([1 - a - b, a, b], axis=1)
            points = SurfacePoints(geometry, materials, scene.textures, face[rows], weights)
            holes[rows] = points.look_up_coverage() < cutoffs[points.numbers]
        return holes

    def _step(self, origins: Array, ways: Array, face: Ints, u: Array, v: Array) -> Array:
        """Return lengths of the directions `ways` that lead just behind the hits, (n,)."""
        geometry = self._find_scene().geometry
        a, b, c = (geometry.positions[geometry.faces[face, i]] for i in range(3))
        way = ways.astype(np.float64)
        square = np.maximum(np.einsum("ij,ij->i", way, way), 1e-300)
        at = a + u[:, None] * (b - a) + v[:, None] * (c - a)
        along = np.maximum(np.einsum("ij,ij->i", at - origins, way) / square, 0)
        step: Array = along * (1 + ONWARD) + ONWARD * geometry.scale / np.sqrt(square)
        return step
