"""The meshes that shadow maps draw, in clusters that follow moving models. No OpenGL."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from deferred_ir.base.arrays import Array, Ints
from deferred_ir.meshes.clusters import Clusters
from deferred_ir.scene.geometry import Geometry
from deferred_ir.scene.vertices import find_groups, find_middle, transform_points


@dataclass(frozen=True, eq=False)
class MapMesh:
    """Triangles that maps draw, at rest: positions (V, 3), faces (F, 3), and the vertices of each moving model."""

    positions: Array
    faces: Ints
    moving: tuple[slice, ...] = ()

    @cached_property
    def groups(self) -> Ints:
        """Model that moves each face, int (F,): 0 for none, i + 1 for moving model i."""
        return find_groups(self.faces, self.moving)

    @cached_property
    def local(self) -> Array:
        """Positions, those of moving models relative to their middles, where 32-bit floats are finest."""
        local = self.positions.copy()
        for vertices in self.moving:
            local[vertices] -= find_middle(local[vertices])
        return local

    @classmethod
    def from_geometry(cls, geometry: Geometry) -> MapMesh:
        """Make the mesh of a scene's triangles."""
        rest = geometry.rest
        return cls(rest.positions, rest.faces, tuple(model.vertices for model in rest.moving))

    def make_clusters(self) -> Clusters:
        """Make clusters, none with triangles of two groups. Those of moving models are not placed yet."""
        return Clusters(self.local, self.faces, groups=self.groups if self.moving else None)

    def pose(self, clusters: Clusters, poses: Array) -> PosedMesh:
        """Place its moving models, in these clusters, by `poses` (m, 4, 4) from rest."""
        return PosedMesh(self, clusters, poses)


@dataclass(frozen=True)
class _MovingPart:
    """A moving model: its vertices (n, 3) at rest, its clusters, and the corners of their faces by vertex, in order."""

    rest: Array
    clusters: slice
    corners: Ints

    @classmethod
    def from_mesh(cls, mesh: MapMesh, clusters: Clusters, number: int) -> _MovingPart:
        vertices, starts = mesh.moving[number], clusters.starts
        whose = mesh.groups[clusters.order[starts[:-1]]]
        first, last = np.searchsorted(whose, (number + 1, number + 2)).tolist()
        faces = mesh.faces[clusters.order[starts[first] : starts[last]]]
        return cls(mesh.positions[vertices], slice(first, last), faces - vertices.start)


class PosedMesh:
    """A mesh in clusters whose boxes follow its moving models."""

    def __init__(self, mesh: MapMesh, clusters: Clusters, poses: Array) -> None:
        self.mesh, self.clusters = mesh, clusters
        self._parts = [_MovingPart.from_mesh(mesh, clusters, number) for number in range(len(mesh.moving))]
        for number, pose in enumerate(poses):
            self.move(number, pose)

    def move(self, number: int, pose: Array) -> tuple[int, Array]:
        """Move model `number` by `pose` (4, 4) from rest. Returns its first vertex and positions, float32 (n, 3)."""
        part = self._parts[number]
        points = transform_points(part.rest, pose).astype(np.float32)
        if part.clusters.stop > part.clusters.start:
            self.clusters.move(part.clusters, points[part.corners])
        return self.mesh.moving[number].start, points
