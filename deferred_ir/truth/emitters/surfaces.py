"""Emitting triangles, textures of emission and holes included, all as one emitter.

A triangle is drawn in proportion to its area and the brightness of its texture at a few points, then a place on it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from deferred_ir.base.arrays import Array, Bools, Ints
from deferred_ir.rays.tracer import Hits
from deferred_ir.scene.scene import Scene
from deferred_ir.truth.emitters.base import LUMINANCE, TINY, Arriving, aim, dot
from deferred_ir.truth.textures import look_up

STEPS = 8
"""Probes of a texture along a triangle's edge."""
LEAST = 0.1
"""Part of the chances that goes by area alone: probes may miss a bright spot."""


@dataclass(frozen=True, eq=False)
class EmittingSurfaces:
    """The triangles of `scene` whose material emits: those that light others, or those that are only seen.

    unlit: whether they are the latter, which have no power and are never sampled.
    """

    scene: Scene
    unlit: bool = False
    can_be_met: ClassVar[bool] = True
    is_seen: ClassVar[bool] = True

    @cached_property
    def emission(self) -> Array:
        """Radiance is absolute."""
        return np.ones(3)

    @property
    def spreads(self) -> bool:
        """They do."""
        return True

    @cached_property
    def _emits(self) -> Bools:
        """Whether each material is of those that emit."""
        materials = self.scene.materials
        return np.array([any(material.emission) and material.unlit == self.unlit for material in materials], bool)

    @cached_property
    def _both(self) -> Bools:
        """Whether each material emits from both sides."""
        return np.array([material.emits_both_sides for material in self.scene.materials], bool)

    @cached_property
    def _faces(self) -> Ints:
        """The triangles that emit."""
        geometry = self.scene.geometry
        faces: Ints = np.flatnonzero(self._emits[geometry.face_materials] & (geometry.face_areas > 0))
        return faces

    @property
    def are_there(self) -> bool:
        """Whether there are any."""
        return len(self._faces) > 0

    @cached_property
    def _powers(self) -> Array:
        """About the luminous flux of each of the triangles that emit."""
        geometry, faces = self.scene.geometry, self._faces
        a, b = (np.mgrid[:STEPS, :STEPS].reshape(2, -1) + 1 / 3) / STEPS
        inside = a + b < 1
        probes = np.stack([1 - a - b, a, b], axis=1)[inside]
        mean = sum(self._look_up(faces, np.tile(probe, (len(faces), 1))) for probe in probes) / len(probes) @ LUMINANCE
        flat = np.array([material.emission for material in self.scene.materials]) @ LUMINANCE
        level = (1 - LEAST) * mean + LEAST * flat[geometry.face_materials[faces]]
        powers: Array = np.pi * geometry.face_areas[faces] * level * (1 + self._both[geometry.face_materials[faces]])
        return powers

    @cached_property
    def power(self) -> float:
        """About their luminous flux."""
        return float(self._powers.sum())

    @cached_property
    def _ends(self) -> Array:
        """The running sums of the triangles' chances."""
        ends: Array = np.cumsum(self._powers) / self.power
        return ends

    @cached_property
    def _density(self) -> Array:
        """The density by area with which places of each of the scene's triangles are drawn, (F,)."""
        density = np.zeros(len(self.scene.geometry.faces))
        if self.unlit:
            return density
        density[self._faces] = self._powers / self.power / self.scene.geometry.face_areas[self._faces]
        return density

    def sample(self, at: Array, points: Array) -> Arriving:
        """Return what arrives from places on them."""
        chosen = np.minimum(np.searchsorted(self._ends, points[:, 0], side="right"), len(self._faces) - 1)
        before = np.where(chosen > 0, self._ends[chosen - 1], 0.0)
        a = np.clip((points[:, 0] - before) / np.maximum(self._ends[chosen] - before, TINY), 0, 1)
        b = points[:, 1].copy()
        # The unit square folded along its diagonal is uniform in a triangle.
        over = a + b > 1
        a[over], b[over] = 1 - a[over], 1 - b[over]
        faces, weights = self._faces[chosen], np.stack([1 - a - b, a, b], axis=1)
        source = np.einsum("ni,nij->nj", weights, self._find_corners(faces))
        to, square = aim(source, at)
        return Arriving(to, source, *self._shine(faces, weights, to, square))

    def meet(self, origins: Array, directions: Array, found: Hits) -> tuple[Array, Array]:
        """Return the radiance that rays find where they hit."""
        radiance, density = np.zeros((len(origins), 3)), np.zeros(len(origins))
        rows = np.flatnonzero(found.hit)
        rows = rows[self._emits[self.scene.geometry.face_materials[found.face[rows]]]]
        faces, way = found.face[rows], found.position[rows] - origins[rows]
        weights = _find_weights(found.position[rows], self._find_corners(faces))
        radiance[rows], density[rows] = self._shine(faces, weights, directions[rows], dot(way, way))
        return radiance, density

    def _shine(self, faces: Ints, weights: Array, to: Array, square: Array) -> tuple[Array, Array]:
        """Return the radiance that places on faces send against unit `to` (n, 3), and the density of these directions.

        square: squared distances, (n,).
        """
        geometry = self.scene.geometry
        facing = -dot(to, geometry.face_normals[faces])
        shines = (facing > 0) | self._both[geometry.face_materials[faces]]
        radiance = self._look_up(faces, weights) * shines[:, None]
        return radiance, self._density[faces] * square / np.maximum(np.abs(facing), 1e-12)

    def _find_corners(self, faces: Ints) -> Array:
        corners: Array = self.scene.geometry.positions[self.scene.geometry.faces[faces]]
        return corners

    def _look_up(self, faces: Ints, weights: Array) -> Array:
        """Return the radiance of the sides that shine, (n, 3), at places of faces by barycentric weights (n, 3)."""
        geometry, materials = self.scene.geometry, self.scene.materials
        numbers = geometry.face_materials[faces]
        radiance = np.array([material.emission for material in materials], float)[numbers]
        for number in np.unique(numbers):
            rows = np.flatnonzero(numbers == number)
            material = materials[number]
            if material.emission_texture is not None:
                glow = look_up(self.scene, material.emission_texture, faces[rows], weights[rows])
                radiance[rows] *= 1 if glow is None else glow[:, :3]
            if material.alpha_cutoff is not None:
                alpha = np.full(len(rows), material.alpha)
                if material.base_color_texture is not None:
                    base = look_up(self.scene, material.base_color_texture, faces[rows], weights[rows])
                    alpha *= 1 if base is None else base[:, 3]
                radiance[rows[alpha < material.alpha_cutoff]] = 0
        return radiance


def _find_weights(positions: Array, corners: Array) -> Array:
    """Return the barycentric weights of positions (n, 3) in triangles (n, 3, 3), (n, 3): areas of parts over all."""
    a, b, c = (corners[:, i] for i in range(3))
    whole = np.cross(b - a, c - a)
    square = np.maximum(dot(whole, whole), TINY)
    second = dot(np.cross(positions - a, c - a), whole) / square
    third = dot(np.cross(b - a, positions - a), whole) / square
    return np.stack([1 - second - third, second, third], axis=1)
