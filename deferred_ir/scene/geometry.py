"""The triangles of a scene, and where its moving models put them. No OpenGL.

A model moves as a whole, so of a moved scene only the vertices and the normals of its moving models are new.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from deferred_ir.base.arrays import Array, Ints, Vec3
from deferred_ir.scene.large_triangles import graded
from deferred_ir.scene.motion import ModelMotion

FAR = 4.0
"""Scenes farther than this many times their `scale` from the origin are moved to it before 32 bits hold them."""
OUTLYING = 16.0
"""Things farther out than this many times the median distance of vertices from their middle leave `scale` as it is."""
SAMPLES = 1 << 16
"""Corners of faces at most that medians are taken of."""


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
        """Its vertices among all."""
        return slice(self.first_vertex, self.first_vertex + self.vertex_count)


@dataclass(frozen=True, eq=False)
class Geometry:
    """All triangles of a scene, indexed.

    positions: float64 (V, 3).
    faces: int32 (F, 3), counter-clockwise from the front.
    face_materials: int32 (F,), index into Scene.materials. Faces are sorted by their material's texture: first those
        without one, then texture 0, 1, ...
    normals: float32 (V, 3) unit shading normals, a zero row where the file has none (the face's normal counts there);
        None if no vertex has one.
    uvs: float32 (V, 2), or None if no material has a texture.
    colors: float32 (V, 3) linear vertex colours that multiply the albedo, or None.
    moving: the models that have a motion; `positions` are where their files put them, or where `posed` did.
    medians: `middle` and `spread` where they are not to be taken from the faces.
    """

    positions: Array
    faces: Ints
    face_materials: Ints
    normals: Array | None = None
    uvs: Array | None = None
    colors: Array | None = None
    moving: tuple[Model, ...] = ()
    medians: tuple[Array, float] | None = None
    _rest: Geometry | None = None
    _poses: Array | None = None
    _last: list[Geometry] = field(default_factory=list, init=False)

    @property
    def rest(self) -> Geometry:
        """What was posed, itself where it rests: faces, materials and all that does not move are the same arrays."""
        return self._rest or self

    @property
    def poses(self) -> Array:
        """Rigid transforms that have brought the moving models from rest to where they are, float64 (m, 4, 4)."""
        return np.tile(np.eye(4), (len(self.moving), 1, 1)) if self._poses is None else self._poses

    @property
    def moves(self) -> bool:
        """Whether `at` gives anything else than itself: what is posed stays."""
        return bool(self.moving) and self._rest is None

    def at(self, time: float) -> Geometry:
        """With all models where they are at `time` seconds; what is posed already stays."""
        if not self.moves:
            return self
        return self.posed(np.stack([model.motion.matrix(time) for model in self.moving if model.motion]))

    def posed(self, poses: Array) -> Geometry:
        """With the moving models brought from rest by `poses` (m, 4, 4). The same object as last time if these are."""
        rest = self.rest
        for last in rest._last[:1]:  # taken once: another thread may pose it meanwhile
            if np.array_equal(last.poses, poses):
                return last
        positions, normals = rest.positions.copy(), None if rest.normals is None else rest.normals.copy()
        for model, pose in zip(rest.moving, poses, strict=True):
            positions[model.vertices] = carried(rest.positions[model.vertices], pose)
            if normals is not None:
                normals[model.vertices] = normals[model.vertices] @ pose[:3, :3].T
        made = replace(rest, positions=positions, normals=normals, _rest=rest, _poses=poses)
        rest._last[:] = [made]
        return made

    @cached_property
    def faces_of(self) -> tuple[Ints, ...]:
        """The faces of each moving model, int (n,) each, ascending."""
        if self._rest:
            return self._rest.faces_of
        return tuple(np.flatnonzero(self.groups == i + 1) for i in range(len(self.moving)))

    @cached_property
    def groups(self) -> Ints:
        """Whose each face is, int (F,): 0 of what stands still, i + 1 of moving model i."""
        return self._rest.groups if self._rest else groups(self.faces, [model.vertices for model in self.moving])

    @cached_property
    def boxes(self) -> Array:
        """Corners (minimum, maximum) of each moving model where it is, float64 (m, 2, 3)."""
        found = [corners(self.positions[model.vertices]) for model in self.moving]
        return np.reshape(found, (len(found), 2, 3))

    @cached_property
    def face_normals(self) -> Array:
        """Unit geometric normals by winding, float64 (F, 3); +y for a degenerate face, which covers no pixel."""
        if not self._rest:
            return _face_normals(self.positions, self.faces)
        normals = self._rest.face_normals.copy()
        for faces in self.faces_of:
            normals[faces] = _face_normals(self.positions, self.faces[faces])
        return normals

    @cached_property
    def bounds(self) -> Array:
        """Corners (minimum, maximum) of all vertices that faces use, float64 (2, 3)."""
        return corners(self.positions[np.unique(self.faces)])

    @cached_property
    def extent(self) -> Array:
        """Corners of a box that is the same wherever the models are: `bounds` where none moves, float64 (2, 3).

        It holds what stands still, and the moving models at each of their keyframes.
        """
        if self._rest:
            return self._rest.extent
        if not self.moving:
            return self.bounds
        still = np.unique(self.faces[self.groups == 0])
        boxes = [corners(self.positions[still])] if len(still) else []
        for model, faces in zip(self.moving, self.faces_of, strict=True):
            used = self.positions[np.unique(self.faces[faces])]
            assert model.motion
            boxes += [corners(carried(used, model.motion.matrix(time))) for time in model.motion.times if len(used)]
        return corners(np.concatenate(boxes))

    @cached_property
    def diagonal(self) -> float:
        """Length of the diagonal of `extent`."""
        return float(np.linalg.norm(self.extent[1] - self.extent[0]))

    @cached_property
    def middle(self) -> Array:
        """The median of the corners of faces, which things far out hardly move, float64 (3,); the same at all times."""
        return self._rest.middle if self._rest else self.medians[0] if self.medians else np.median(self._some, axis=0)

    @cached_property
    def spread(self) -> float:
        """The median of the distances of the corners of faces from the middle; the same at all times."""
        if self._rest:
            return self._rest.spread
        if self.medians:
            return self.medians[1]
        return float(np.median(np.linalg.norm(self._some - self.middle, axis=1)))

    @property
    def _some(self) -> Array:
        """Corners of faces, (n, 3): all, or SAMPLES of very many, with moving models at their first keyframes."""
        used = self.faces.ravel()
        first = [model.motion.matrix(model.motion.times[0]) for model in self.moving if model.motion]
        positions = self.posed(np.stack(first)).positions if first else self.positions
        return positions[used[:: -(-len(used) // SAMPLES)]]

    @cached_property
    def scale(self) -> float:
        """What near planes and offsets are fractions of: the diagonal, unless a few things lie very far out."""
        return min(self.diagonal, OUTLYING * self.spread) if self.spread > 0 else self.diagonal

    @cached_property
    def centre(self) -> Vec3:
        """Where the origin of 32-bit coordinates lies: the middle of most where that is far off, else 0."""
        middle = self.middle
        x, y, z = middle.tolist() if np.abs(middle).max() > FAR * self.scale else (0.0, 0.0, 0.0)
        return x, y, z

    @cached_property
    def centred(self) -> Geometry:
        """The same as 32 bits hold it best: with `centre` as its origin, and without giant triangles (giants.py).

        Itself where nothing has to be done. Both are done in 64 bits.
        """
        if not any(self.centre):
            return self._graded
        if self._rest:
            poses = self.poses.copy()
            poses[:, :3, 3] += poses[:, :3, :3] @ self.centre - self.centre
            return self._rest.centred.posed(poses)
        moving = tuple(
            replace(model, motion=model.motion.seen_from(self.centre)) for model in self.moving if model.motion
        )
        middle = self.middle - self.centre
        near = replace(self, positions=self.positions - self.centre, moving=moving, medians=(middle, self.spread))
        return near._graded

    @property
    def _graded(self) -> Geometry:
        if self._rest:
            whole = self._rest.centred
            return self if whole is self._rest else whole.posed(self.poses)
        return graded(self)


def corners(points: Array) -> Array:
    """Minimum and maximum of points (n, 3), (2, 3)."""
    return np.stack([points.min(axis=0), points.max(axis=0)])


def middle(points: Array) -> Array:
    """Of the box about points (n, 3), (3,); 0 where there are none."""
    return corners(points).mean(axis=0) if len(points) else np.zeros(3)


def carried(points: Array, pose: Array) -> Array:
    """Points (n, 3) brought along by a rigid transform (4, 4), float64 (n, 3)."""
    moved: Array = points @ pose[:3, :3].T + pose[:3, 3]
    return moved


def groups(faces: Ints, ranges: Sequence[slice]) -> Ints:
    """Whose each of `faces` (F, 3) is, int (F,): i + 1 where its vertices lie in ranges[i], 0 where in none."""
    found = np.zeros(len(faces), np.intp)
    for number, vertices in enumerate(ranges, start=1):
        found[(faces[:, 0] >= vertices.start) & (faces[:, 0] < vertices.stop)] = number
    return found


def _face_normals(positions: Array, faces: Ints) -> Array:
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
