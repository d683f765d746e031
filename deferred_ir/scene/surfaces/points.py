"""What materials say at points of a scene's surfaces: the numbers that the G-buffer pass computes on the GPU."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from deferred_ir.base.arrays import Array, Ints
from deferred_ir.scene.geometry import Geometry
from deferred_ir.scene.surfaces.brdf import Gloss, make_gloss
from deferred_ir.scene.surfaces.materials import Material, Texture, TextureRef
from deferred_ir.scene.surfaces.texture_lookup import find_uvs, has_uvs, sample_texture


@dataclass(frozen=True, eq=False)
class SurfacePoints:
    """Points of a scene's surfaces: its geometry, materials and textures, faces (n,), barycentric weights (n, 3)."""

    geometry: Geometry
    materials: Sequence[Material]
    textures: Sequence[Texture]
    faces: Ints
    weights: Array

    @cached_property
    def numbers(self) -> Ints:
        """Their materials, (n,)."""
        return self.geometry.face_materials[self.faces]

    def look_up_base_color(self) -> Array:
        """Return the base colour, linear RGB, float64 (n, 3): the material's times vertex colour times texture."""
        color: Array = np.array([material.base_color for material in self.materials], dtype=np.float64)[self.numbers]
        geometry = self.geometry
        if geometry.colors is not None:
            blend = np.asarray(self.weights, dtype=np.float64)[..., None]
            color *= (geometry.colors[geometry.faces[self.faces]] * blend).sum(axis=1)
        self._multiply(color, [material.base_color_texture for material in self.materials])
        return color

    def look_up_emission(self) -> Array:
        """Return the radiance emitted from the sides that shine, float64 (n, 3)."""
        radiance: Array = np.array([material.emission for material in self.materials], dtype=np.float64)[self.numbers]
        self._multiply(radiance, [material.emission_texture for material in self.materials])
        return radiance

    def look_up_coverage(self) -> Array:
        """Return alpha, float64 (n,): the material's times its base colour texture's."""
        alpha: Array = np.array([material.alpha for material in self.materials], dtype=np.float64)[self.numbers]

        def multiply(texture: TextureRef, rows: Ints) -> None:
            image = self.textures[texture.number]
            if image.pixels.shape[2] > 3:
                alpha[rows] *= sample_texture(image, self._find_uvs(texture, rows), texture.sampler, channels=4)[:, 3]

        self._for_each([material.base_color_texture for material in self.materials], multiply)
        return alpha

    def look_up_gloss(self, base_color: Array) -> tuple[Array, Gloss]:
        """Return the albedo, float64 (n, 3), and what gloss follows from, of surfaces with `base_color` (n, 3)."""
        table = np.array([(m.metallic, m.roughness) for m in self.materials], dtype=np.float64)
        metallic, roughness = table[self.numbers].T.copy()

        def multiply(texture: TextureRef, rows: Ints) -> None:
            found = self._sample_numbers(texture, rows)
            roughness[rows] *= found[:, 1]
            metallic[rows] *= found[:, 2]

        self._for_each([material.metallic_roughness_texture for material in self.materials], multiply)
        return make_gloss(self.materials, self.numbers, base_color, metallic, roughness)

    def bend_normals(self, normals: Array) -> Array:
        """Return shading normals (n, 3), turned as normal maps say, unit, float64 (n, 3).

        normals: unit, on the side that the file's normals point to.
        """
        tangents = self.geometry.tangents
        if tangents is None:
            return normals
        result, used = normals.copy(), tangents

        def bend(texture: TextureRef, rows: Ints) -> None:
            scale = np.array([material.normal_scale for material in self.materials])[self.numbers[rows]]
            x, y, z = (self._sample_numbers(texture, rows) * 2 - 1).T
            blend = np.asarray(self.weights[rows], dtype=np.float64)[..., None]
            frames = (used[self.geometry.faces[self.faces[rows]]].astype(np.float64) * blend).sum(axis=1)
            along, sign = frames[:, :3], np.where(frames[:, 3] < 0, -1.0, 1.0)
            across = np.cross(normals[rows], along) * sign[:, None]
            bent = along * (x * scale)[:, None] + across * (y * scale)[:, None] + normals[rows] * z[:, None]
            length = np.sqrt(np.einsum("ij,ij->i", bent, bent))
            known = (length > 1e-6) & along.any(axis=1)
            result[rows[known]] = bent[known] / length[known, None]

        self._for_each([material.normal_texture for material in self.materials], bend)
        return result

    def _multiply(self, colors: Array, wanted: Sequence[TextureRef | None]) -> None:
        """Multiply `colors` (n, 3) by textures, one or none for each material."""

        def multiply(texture: TextureRef, rows: Ints) -> None:
            image = self.textures[texture.number]
            colors[rows] *= sample_texture(image, self._find_uvs(texture, rows), texture.sampler)

        self._for_each(wanted, multiply)

    def _sample_numbers(self, texture: TextureRef, rows: Ints) -> Array:
        """Return three channels of a texture that is no colour, (m, 3)."""
        uvs = self._find_uvs(texture, rows)
        return sample_texture(self.textures[texture.number], uvs, texture.sampler, color=False)

    def _find_uvs(self, texture: TextureRef, rows: Ints) -> Array:
        return find_uvs(self.geometry, texture, self.faces[rows], self.weights[rows])

    def _for_each(self, wanted: Sequence[TextureRef | None], change: Callable[[TextureRef, Ints], None]) -> None:
        """Call `change` with each texture, of those wanted by materials, that points are on, and the points' rows."""
        if not any(wanted):
            return
        for number in np.unique(self.numbers):
            texture = wanted[number]
            if texture is not None and has_uvs(self.geometry, texture):
                change(texture, np.flatnonzero(self.numbers == number))
