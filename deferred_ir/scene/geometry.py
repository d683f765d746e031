"""The triangles of a scene at rest and with its moving models posed.

A model moves as a whole, so posing it changes the vertices and the normals of moving models and nothing else.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from deferred_ir.base.arrays import Array, Ints, Vec3
from deferred_ir.scene.motion import ModelMotion
from deferred_ir.scene.vertices import (
    compute_face_areas,
    compute_face_normals,
    find_bounds,
    find_groups,
    transform_points,
)

FAR = 4.0
"""A scene whose middle is farther from the origin than this many times its `scale` gets a `centre` of its own."""
OUTLYING = 16.0
"""Vertices farther from the middle than this many times the median distance do not count in `scale`."""
SAMPLES = 1 << 16
"""Most corners of faces of which medians are taken."""


@dataclass(frozen=True)
class Model:
    """One [[model]] of the scene file and its range of vertices.

    Its faces are those that use these vertices; they need not be neighbours, since faces are sorted by texture.
    """

    name: str
    first_vertex: int
    vertex_count: int
    motion: ModelMotion | None = None

    @property
    def vertices(self) -> slice:
        """The slice of its vertices among all vertices of the scene."""
        return slice(self.first_vertex, self.first_vertex + self.vertex_count)


@dataclass(eq=False)
class _LastPose:
    """The pose that a geometry was put in last, so that the same pose is the same object."""

    geometry: PosedGeometry | None = None


@dataclass(frozen=True, eq=False)
class Geometry:
    """All triangles of a scene, indexed, with moving models at rest, where their files put them.

    positions: float64 (V, 3).
    faces: int32 (F, 3), counter-clockwise from the front.
    face_materials: int32 (F,), index into Scene.materials. Loading sorts faces by the textures of these.
    normals: float32 (V, 3) unit shading normals, a zero row where the file has none (the face's normal counts there);
        None if no vertex has one.
    uvs, second_uvs: float32 (V, 2), v upwards; None if no texture is read by them.
    tangents: float32 (V, 4), unit, along u of the normal map; the bitangent is the fourth * cross(normal, tangent). A
        zero row where there is none; None without normal maps.
    colors: float32 (V, 3) linear vertex colours that multiply the albedo, or None.
    moving: the models that have a motion.
    medians: overrides `middle` and `spread`, which are otherwise computed from the faces.
    """

    positions: Array
    faces: Ints
    face_materials: Ints
    normals: Array | None = None
    uvs: Array | None = None
    colors: Array | None = None
    second_uvs: Array | None = None
    tangents: Array | None = None
    moving: tuple[Model, ...] = ()
    medians: tuple[Array, float] | None = None
    _last_pose: _LastPose = field(default_factory=_LastPose, init=False, repr=False)

    @property
    def rest(self) -> Geometry:
        """The geometry with all models at rest; posing shares every array with it that does not change."""
        return self

    @property
    def poses(self) -> Array:
        """Rigid transforms of the moving models from rest to where they are, float64 (m, 4, 4)."""
        return np.tile(np.eye(4), (len(self.moving), 1, 1))

    @property
    def is_smooth(self) -> bool:
        """Whether shading normals may differ from the faces'."""
        return self.normals is not None or self.tangents is not None

    @property
    def moves(self) -> bool:
        """Whether `at` depends on the time."""
        return bool(self.moving)

    def at(self, time: float) -> Geometry:
        """Return the geometry with all models where they are at `time` seconds; itself where none moves."""
        if not self.moving:
            return self
        return self.pose(np.stack([model.motion.matrix(time) for model in self.moving if model.motion]))

    def pose(self, poses: Array) -> PosedGeometry:
        """Return the geometry with its moving models brought from rest by `poses` (m, 4, 4).

        It is the same object as last time if the poses are equal.
        """
        last = self._last_pose.geometry  # read once: another thread may pose this geometry meanwhile
        if last is not None and np.array_equal(last.poses, poses):
            return last
        positions = self.positions.copy()
        normals, tangents = (None if array is None else array.copy() for array in (self.normals, self.tangents))
        for model, matrix in zip(self.moving, poses, strict=True):
            positions[model.vertices] = transform_points(self.positions[model.vertices], matrix)
            if normals is not None:
                normals[model.vertices] = normals[model.vertices] @ matrix[:3, :3].T
            if tangents is not None:
                tangents[model.vertices, :3] = tangents[model.vertices, :3] @ matrix[:3, :3].T
        posed = PosedGeometry(
            positions,
            self.faces,
            self.face_materials,
            normals,
            self.uvs,
            self.colors,
            self.second_uvs,
            tangents,
            self.moving,
            _rest=self,
            _poses=poses,
        )
        self._last_pose.geometry = posed
        return posed

    @cached_property
    def groups(self) -> Ints:
        """Number of the moving model that each face belongs to, int (F,): 0 for none, i + 1 for moving model i."""
        return find_groups(self.faces, [model.vertices for model in self.moving])

    @cached_property
    def faces_of_models(self) -> tuple[Ints, ...]:
        """The faces of each moving model, int (n,) each, ascending."""
        return tuple(np.flatnonzero(self.groups == i + 1) for i in range(len(self.moving)))

    @cached_property
    def boxes(self) -> Array:
        """Corners (minimum, maximum) of each moving model where it is, float64 (m, 2, 3)."""
        boxes = [find_bounds(self.positions[model.vertices]) for model in self.moving]
        return np.reshape(boxes, (len(boxes), 2, 3))

    @cached_property
    def face_normals(self) -> Array:
        """Unit geometric normals by winding, float64 (F, 3); +y for a degenerate face, which covers no pixel."""
        return compute_face_normals(self.positions, self.faces)

    @cached_property
    def face_areas(self) -> Array:
        """Areas of the faces, float64 (F,); rigid motions keep them."""
        return compute_face_areas(self.rest.positions, self.faces)

    @cached_property
    def bounds(self) -> Array:
        """Corners (minimum, maximum) of all vertices that faces use, float64 (2, 3)."""
        return find_bounds(self.positions[np.unique(self.faces)])

    @cached_property
    def extent(self) -> Array:
        """Corners of a box that does not depend on the time, float64 (2, 3): `bounds` where no model moves.

        It encloses everything static, and the moving models at each of their keyframes.
        """
        if not self.moving:
            return self.bounds
        static = np.unique(self.faces[self.groups == 0])
        boxes = [find_bounds(self.positions[static])] if len(static) else []
        for model, faces in zip(self.moving, self.faces_of_models, strict=True):
            used = self.positions[np.unique(self.faces[faces])]
            assert model.motion
            boxes += [
                find_bounds(transform_points(used, model.motion.matrix(time)))
                for time in model.motion.times
                if len(used)
            ]
        return find_bounds(np.concatenate(boxes))

    @cached_property
    def diagonal(self) -> float:
        """Length of the diagonal of `extent`."""
        return float(np.linalg.norm(self.extent[1] - self.extent[0]))

    @cached_property
    def middle(self) -> Array:
        """The median of the corners of faces, float64 (3,), which outliers hardly move; the same at all times."""
        return self.medians[0] if self.medians else np.median(self._sampled_corners, axis=0)

    @cached_property
    def spread(self) -> float:
        """The median distance of the corners of faces from the middle; the same at all times."""
        if self.medians:
            return self.medians[1]
        return float(np.median(np.linalg.norm(self._sampled_corners - self.middle, axis=1)))

    @property
    def _sampled_corners(self) -> Array:
        """Corners of faces, (n, 3): all or, of very many, SAMPLES, with moving models at their first keyframes."""
        used = self.faces.ravel()
        first = [model.motion.matrix(model.motion.times[0]) for model in self.moving if model.motion]
        positions = self.pose(np.stack(first)).positions if first else self.positions
        return positions[used[:: -(-len(used) // SAMPLES)]]

    @cached_property
    def scale(self) -> float:
        """The length of which near planes and offsets are fractions: the diagonal, unless a few things lie far out."""
        return min(self.diagonal, OUTLYING * self.spread) if self.spread > 0 else self.diagonal

    @cached_property
    def centre(self) -> Vec3:
        """The origin of 32-bit coordinates: the middle where that is far from the world's origin, else 0."""
        middle = self.middle
        x, y, z = middle.tolist() if np.abs(middle).max() > FAR * self.scale else (0.0, 0.0, 0.0)
        return x, y, z


@dataclass(frozen=True, eq=False, kw_only=True)
class PosedGeometry(Geometry):
    """A geometry whose moving models were brought from rest by `poses`; `Geometry.pose` makes it.

    Whatever a pose does not change is taken from the geometry at rest. It stays as it is at all times.
    """

    _rest: Geometry
    _poses: Array

    @property
    def rest(self) -> Geometry:
        """The geometry with all models at rest; every array that posing does not change is shared with it."""
        return self._rest

    @property
    def poses(self) -> Array:
        """Rigid transforms of the moving models from rest to where they are, float64 (m, 4, 4)."""
        return self._poses

    @property
    def moves(self) -> bool:
        """False: what is posed stays."""
        return False

    def at(self, time: float) -> Geometry:
        """Return itself: what is posed stays."""
        del time
        return self

    def pose(self, poses: Array) -> PosedGeometry:
        """Return the geometry in another pose, `poses` (m, 4, 4) from rest."""
        return self._rest.pose(poses)

    @cached_property
    def groups(self) -> Ints:
        """Number of the moving model that each face belongs to, as at rest."""
        return self._rest.groups

    @cached_property
    def faces_of_models(self) -> tuple[Ints, ...]:
        """The faces of each moving model, as at rest."""
        return self._rest.faces_of_models

    @cached_property
    def face_normals(self) -> Array:
        """Unit geometric normals, float64 (F, 3); only those of moving models are computed."""
        normals = self._rest.face_normals.copy()
        for faces in self.faces_of_models:
            normals[faces] = compute_face_normals(self.positions, self.faces[faces])
        return normals

    @cached_property
    def extent(self) -> Array:
        """Corners of the box that does not depend on the time, float64 (2, 3)."""
        return self._rest.extent

    @cached_property
    def middle(self) -> Array:
        """The median of the corners of faces, float64 (3,); the same at all times."""
        return self._rest.middle

    @cached_property
    def spread(self) -> float:
        """The median distance of the corners of faces from the middle; the same at all times."""
        return self._rest.spread
