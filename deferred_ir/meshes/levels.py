"""Levels of detail of a scene's triangles: each map draws each chunk as coarsely as its texels allow. No OpenGL.

The scene is cut into chunks, each simplified on its own (simplify.py). Vertices that chunks share stay, so chunks of
different levels fit together without a gap, and each light chooses a level by its distance from each chunk.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from weakref import WeakKeyDictionary

import numpy as np

from deferred_ir.base.arrays import Array, Bools, Ints
from deferred_ir.meshes.clusters import Clusters, split_points
from deferred_ir.meshes.posed import MapMesh
from deferred_ir.meshes.simplify import simplify, weld_vertices
from deferred_ir.scene.geometry import Geometry

CHUNK = 2048
"""Most triangles in a chunk: large enough that few vertices lie where chunks meet."""
COARSEST = 0.01
"""Deviation of the coarsest level as a fraction of the scene's diagonal; each finer level has a third of the next."""
LEVELS = 5

_known: WeakKeyDictionary[Geometry, Levels] = WeakKeyDictionary()


@dataclass(frozen=True)
class Levels:
    """The levels of detail of a scene.

    faces: (F, 3), of all levels, on the scene's vertices. level, chunk: (F,), of each face; a chunk is a group of
    neighbouring triangles that has all levels. deviations: (L,), of the
    levels, ascending from 0, in world units. boxes: (2, C, 3), corners of the chunks, in moving models' own
    coordinates where they belong to one. No chunk has triangles of two models that move independently.
    """

    faces: Ints
    level: Ints
    chunk: Ints
    deviations: Array
    boxes: Array


def find_levels(geometry: Geometry) -> Levels:
    """Return a scene's levels; building them takes some seconds for 100,000 triangles, once in a process."""
    if geometry not in _known:
        _known[geometry] = _build_levels(geometry)
    return _known[geometry]


def make_mesh(geometry: Geometry) -> MapMesh:
    """Make the mesh of the triangles of all levels."""
    return replace(MapMesh.from_geometry(geometry), faces=find_levels(geometry).faces)


def _build_levels(geometry: Geometry) -> Levels:
    positions = MapMesh.from_geometry(geometry).local.astype(np.float32)
    faces = np.empty_like(geometry.faces)
    for group in range(1 + len(geometry.moving)):  # models stay apart where they touch at rest
        own = np.flatnonzero(geometry.groups == group)
        faces[own] = weld_vertices(positions, geometry.faces[own])
    corners = positions[faces]
    low, high = corners.min(axis=1), corners.max(axis=1)
    order, starts = split_points(low / 2 + high / 2, geometry.groups, CHUNK)
    chunk = np.empty(len(faces), np.intp)
    chunk[order] = np.repeat(np.arange(len(starts) - 1), np.diff(starts))
    first, last = np.full(len(positions), len(starts)), np.full(len(positions), -1)
    for corner in faces.T:
        np.minimum.at(first, corner, chunk)
        np.maximum.at(last, corner, chunk)
    deviations = COARSEST * geometry.diagonal * 3.0 ** np.arange(1 - LEVELS, 1)
    meshes = [(faces, np.arange(len(faces))), *simplify(positions, faces, deviations.tolist(), locked=first < last)]
    boxes = [np.minimum.reduceat(low[order], starts[:-1]), np.maximum.reduceat(high[order], starts[:-1])]
    return Levels(
        faces=np.concatenate([left for left, _ in meshes]),
        level=np.repeat(np.arange(len(meshes)), [len(left) for left, _ in meshes]),
        chunk=np.concatenate([chunk[origin] for _, origin in meshes]),
        deviations=np.append(0.0, deviations),
        boxes=np.stack(boxes),
    )


class LevelClusters(Clusters):
    """Clusters of all levels; a light draws each chunk at the coarsest level within its tolerance.

    tolerance: returns for LIGHT records (n,) the largest deviation, (n,), as a fraction of the distance from the light.
    """

    def __init__(self, mesh: MapMesh, detail: Levels, tolerance: Callable[[np.ndarray], Array]) -> None:
        levels, chunks = len(detail.deviations), detail.boxes.shape[1]
        groups = (mesh.groups * levels + detail.level) * chunks + detail.chunk
        super().__init__(mesh.local, detail.faces, groups=groups)
        first = self.order[self.starts[:-1]]
        self._level, self._chunk = detail.level[first], detail.chunk[first]
        self._detail, self._tolerance, self._chunks = detail, tolerance, detail.boxes.copy()

    def move(self, chosen: slice, corners: Array) -> None:
        """Update the boxes of clusters, as in Clusters, and of chunks, by which levels are chosen."""
        super().move(chosen, corners)
        faces = self.order[self.starts[chosen.start] : self.starts[chosen.stop]]
        finest = self._detail.level[faces] == 0
        chunk, corners = self._detail.chunk[faces[finest]], corners[finest]
        low, high = self._chunks
        low[chunk], high[chunk] = np.inf, -np.inf
        np.minimum.at(low, chunk, corners.min(axis=1))
        np.maximum.at(high, chunk, corners.max(axis=1))

    def find_visible(self, lights: np.ndarray, *, hemisphere: bool = False) -> Bools:
        """Find the clusters that may show, as in Clusters, among the levels that the lights draw."""
        return super().find_visible(lights, hemisphere=hemisphere) & self.find_drawn(lights)

    def find_drawn(self, lights: np.ndarray) -> Bools:
        """Find the clusters of the levels that `lights`, LIGHT records (n,), draw of each chunk: bool (n, C)."""
        position = lights["position"][:, None].astype(np.float64)
        low, high = self._chunks
        away = np.maximum(np.maximum(low - position, position - high), 0)
        allowed = self._tolerance(lights)[:, None] * np.sqrt((away**2).sum(axis=-1))
        chosen = np.searchsorted(self._detail.deviations[1:], allowed, side="right")
        drawn: Bools = chosen[:, self._chunk] == self._level
        return drawn
