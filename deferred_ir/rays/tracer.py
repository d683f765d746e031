"""Ray queries: closest hits with everything a light path needs, and occlusion between points.

embreex runs in one thread and releases the GIL, so rays go out in chunks over a thread pool. It is an optional
dependency (no Linux arm64 wheel): without it `Tracer` raises a one-line DeviceError.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from deferred_ir.base.arrays import Array, Bools, Ints
from deferred_ir.rays.cutouts import CutOutRays
from deferred_ir.rays.embree import INFINITE, EmbreeScenes
from deferred_ir.scene.scene import Scene
from deferred_ir.scene.surfaces.brdf import Gloss, find_mean_kept
from deferred_ir.scene.surfaces.points import SurfacePoints
from deferred_ir.scene.vertices import find_weights

CHUNK = 1 << 15
OFFSET = 1e-5
"""Ray origins are pushed off their surface by this fraction of the scene's scale, or of their own distance from the
origin where that is larger: float32 positions err by 1e-7 of it."""


@dataclass(frozen=True, eq=False)
class Hits:
    """The closest hits of n rays; rows of rays that miss hold zeros and face -1.

    face: int32 (n,). position: float64 (n, 3). albedo: diffuse reflectance, float64 (n, 3).
    normal: geometric normal, shading_normal: both unit, float64 (n, 3), facing
        the ray's origin as docs/conventions.md says.
    gloss: of all rows; None where no surface of the scene is glossy.
    """

    face: Ints
    position: Array
    normal: Array
    shading_normal: Array
    albedo: Array
    gloss: Gloss | None = None

    @property
    def hit(self) -> Bools:
        """Which rays met a surface, bool (n,)."""
        return self.face >= 0

    def reflect_diffusely(self, directions: Array) -> Array:
        """Return the fraction of light along unit `directions` (n, 3), the rays', that is reflected diffusely, (n, 3).

        The coat takes more of what goes to some directions than to others; this is about their mean.
        """
        if self.gloss is None:
            return self.albedo
        cosines = -np.einsum("ij,ij->i", self.shading_normal, directions)
        reflected: Array = self.albedo * find_mean_kept(self.gloss, cosines)[:, None]
        return reflected

    def rows(self, chosen: Ints) -> Hits:
        """Return the hits of the rays `chosen`, indices (m,)."""
        gloss = None if self.gloss is None else self.gloss.rows(chosen)
        return Hits(
            self.face[chosen],
            self.position[chosen],
            self.normal[chosen],
            self.shading_normal[chosen],
            self.albedo[chosen],
            gloss,
        )


class Tracer:
    """Ray queries on one scene. Build it once a scene, and let it `follow` the scene's moving models.

    `seconds` is the time spent in queries so far, nearly all of it inside Embree.
    """

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.seconds = 0.0
        self._rays: EmbreeScenes | CutOutRays = EmbreeScenes(scene.geometry)
        if scene.has_cutouts:
            self._rays = CutOutRays(self._rays, lambda: self.scene)
        self.offset = OFFSET * scene.geometry.scale

    def follow(self, scene: Scene) -> None:
        """Move to the same triangles as `scene` has them, with its moving models elsewhere."""
        if scene.geometry is not self.scene.geometry:
            self._rays.pose(scene.geometry)
        self.scene = scene

    @cached_property
    def _pool(self) -> ThreadPoolExecutor:
        return ThreadPoolExecutor(os.cpu_count())

    def _map(self, function: Callable[[slice], Any], count: int) -> list[Any]:
        """Return the results of `function` for chunks of `count` rays, in order; several chunks run on threads."""
        chunks = [slice(start, start + CHUNK) for start in range(0, count, CHUNK)]
        start = time.perf_counter()
        results = list(self._pool.map(function, chunks)) if len(chunks) > 1 else [function(chunk) for chunk in chunks]
        self.seconds += time.perf_counter() - start
        return results

    def closest(self, origins: Array, directions: Array) -> Hits:
        """Return the first surfaces that rays (n, 3), (n, 3) hit; the caller offsets origins that lie on a surface."""
        org, dirs = (np.ascontiguousarray(vectors, np.float32) for vectors in (origins, directions))
        face, u, v = self._first(lambda chunk: self._rays.closest(org[chunk], dirs[chunk]), len(org))
        u, v = u.astype(np.float64), v.astype(np.float64)
        return self._hits(face, np.stack([1 - u - v, u, v], axis=-1), np.asarray(directions, np.float64))

    def within(self, origins: Array, directions: Array, reach: Array | float) -> tuple[Ints, Hits]:
        """Find the rays (n, 3), (n, 3) that hit a surface within `reach` lengths of their directions, one or (n,).

        Returns the rows of these rays (m,), ascending, and their m closest hits; rays that miss cost little.
        """
        org, dirs = (np.ascontiguousarray(vectors, np.float32) for vectors in (origins, directions))
        ends = np.broadcast_to(np.minimum(reach, INFINITE).astype(np.float32), len(org))
        face, u, v = self._first(lambda chunk: self._rays.closest(org[chunk], dirs[chunk], ends[chunk]), len(org))
        rows = np.flatnonzero(face >= 0)
        u, v = u[rows].astype(np.float64), v[rows].astype(np.float64)
        weights = np.stack([1 - u - v, u, v], axis=-1)
        return rows, self._hits(face[rows], weights, np.asarray(directions[rows], np.float64))

    def _first(self, ask: Callable[[slice], tuple[Ints, Array, Array]], count: int) -> tuple[Ints, Array, Array]:
        """Query all chunks of rays by `ask` and join the results: faces, u and v."""
        parts = [(np.zeros(0, np.int32), np.zeros(0, np.float32), np.zeros(0, np.float32)), *self._map(ask, count)]
        face, u, v = (np.concatenate(column) for column in zip(*parts, strict=True))
        return face, u, v

    def _hits(self, face: Ints, weights: Array, directions: Array) -> Hits:
        geometry = self.scene.geometry
        hit = face >= 0
        corners, weights = geometry.faces[face[hit]], weights[hit]
        position, normal, shading, albedo = (np.zeros((len(face), 3)) for _ in range(4))
        position[hit] = interpolate(geometry.positions, corners, weights)
        own = geometry.face_normals[face[hit]]
        normal[hit] = shading[hit] = facing = face_towards(own, -directions[hit])
        scene = self.scene
        at = SurfacePoints(geometry, scene.materials, scene.textures, face[hit], weights)
        if geometry.is_smooth:
            smooth = own.copy()
            if geometry.normals is not None:
                blend = interpolate(geometry.normals, corners, weights)
                length = np.sqrt(np.einsum("ij,ij->i", blend, blend))
                has = length > 1e-6
                smooth[has] = blend[has] / length[has, None]
            shading[hit] = face_towards(at.bend_normals(smooth), facing)
        base = at.look_up_base_color()
        if not scene.has_gloss:
            albedo[hit] = base
            return Hits(face, position, normal, shading, albedo)
        albedo[hit], gloss = at.look_up_gloss(base)
        return Hits(face, position, normal, shading, albedo, gloss.spread(hit))

    def find_emission(self, hits: Hits, directions: Array) -> Array:
        """Return the radiance that hits (n,) of rays in `directions` (n, 3) emit against them, float64 (n, 3)."""
        scene, radiance = self.scene, np.zeros((len(hits.face), 3))
        rows = np.flatnonzero(hits.hit) if scene.shows_emission else np.zeros(0, int)
        materials = scene.geometry.face_materials[hits.face[rows]]
        both = np.array([material.emits_both_sides for material in scene.materials], bool)[materials]
        front = np.einsum("ij,ij->i", scene.geometry.face_normals[hits.face[rows]], directions[rows]) < 0
        rows = rows[front | both]
        if len(rows):
            faces = hits.face[rows]
            weights = find_weights(hits.position[rows], scene.geometry.positions[scene.geometry.faces[faces]])
            points = SurfacePoints(scene.geometry, scene.materials, scene.textures, faces, weights)
            radiance[rows] = points.look_up_emission()
        return radiance

    def occluded(self, origins: Array, targets: Array, *, lifted: bool = False) -> Bools:
        """Return whether anything lies strictly between points (n, 3) and (n, 3), bool (n,).

        Rays stop short by a ten-thousandth of the way, so targets may lie on surfaces; an origin on a surface must be
        offset (see `lift`). lifted: targets are offset as well, and the whole way counts, since a wall may stand close
        to them.
        """
        end = np.float32(1 if lifted else 1 - 1e-4)

        def ask(chunk: slice) -> Bools:
            start = origins[chunk]
            way = np.ascontiguousarray(targets[chunk] - start, np.float32)
            return self._rays.occluded(np.ascontiguousarray(start, np.float32), way, np.full(len(way), end))

        return np.concatenate([np.zeros(0, bool), *self._map(ask, len(origins))])

    def lift(self, positions: Array, normals: Array) -> Array:
        """Return points pushed off their surfaces along `normals`, so that rays from them do not hit these again."""
        x, y, z = np.abs(positions).T  # a maximum along rows of three would be slow
        far = OFFSET * np.maximum(np.maximum(x, y), z)
        lifted: Array = positions + normals * np.maximum(far, self.offset)[..., None]
        return lifted


def interpolate(values: Array, corners: Ints, weights: Array) -> Array:
    """Interpolate the rows of `values` (v, 3) at `corners` (n, 3) by barycentric `weights` (n, 3), float64 (n, 3)."""
    a, b, c = (values[corners[:, i]] * weights[:, i, None] for i in range(3))
    total: Array = a + b + c
    return total


def face_towards(normals: Array, towards: Array) -> Array:
    """Return `normals` (n, 3), flipped where they point away from `towards` (n, 3)."""
    away = np.einsum("ij,ij->i", normals, towards) < 0
    return np.where(away[:, None], -normals, normals)
