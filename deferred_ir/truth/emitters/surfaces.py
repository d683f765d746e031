"""Emitting triangles, textures of emission included, all as one emitter.

A triangle is drawn in proportion to its area and the brightness of its texture at a few points, then a place on it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from deferred_ir.base.arrays import Array, Bools, Ints
from deferred_ir.base.colour import srgb_table
from deferred_ir.rays.tracer import Hits
from deferred_ir.scene.scene import Scene
from deferred_ir.truth.emitters.base import LUMINANCE, TINY, Arriving, aim, dot

STEPS = 8
"""Probes of a texture along a triangle's edge."""
LEAST = 0.1
"""Part of the chances that goes by area alone: probes may miss a bright spot."""


@dataclass(frozen=True, eq=False)
class EmittingSurfaces:
    """The triangles of `scene` whose material emits."""

    scene: Scene
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
        """Whether each material emits."""
        return np.array([any(material.emission) for material in self.scene.materials], bool)

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
            image = materials[number].emission_texture
            if image is not None and geometry.uvs is not None:
                rows = np.flatnonzero(numbers == number)
                uvs = np.einsum("ni,nij->nj", weights[rows], geometry.uvs[geometry.faces[faces[rows]]].astype(float))
                radiance[rows] *= _look_up_texture(self.scene.textures[image.number].pixels, uvs)
        return radiance


def _find_weights(positions: Array, corners: Array) -> Array:
    """Return the barycentric weights of positions (n, 3) in triangles (n, 3, 3), (n, 3): areas of parts over all."""
    a, b, c = (corners[:, i] for i in range(3))
    whole = np.cross(b - a, c - a)
    square = np.maximum(dot(whole, whole), TINY)
    second = dot(np.cross(positions - a, c - a), whole) / square
    third = dot(np.cross(b - a, positions - a), whole) / square
    return np.stack([1 - second - third, second, third], axis=1)


def _look_up_texture(pixels: Array, uvs: Array) -> Array:
    """Return linear RGB (n, 3) at uvs (n, 2), bilinear and repeating, of 8-bit sRGB pixels whose top edge is v = 1."""
    height, width = pixels.shape[:2]
    x, y = uvs[:, 0] * width - 0.5, (1 - uvs[:, 1]) * height - 0.5
    left, top = np.floor(x).astype(np.int64), np.floor(y).astype(np.int64)
    found = np.zeros((len(uvs), 3))
    for i, across in ((0, 1 - (x - left)), (1, x - left)):
        for j, down in ((0, 1 - (y - top)), (1, y - top)):
            found += srgb_table()[pixels[(top + j) % height, (left + i) % width]] * (across * down)[:, None]
    return found
