"""Reflectance and emission at points of a scene's surfaces: what the G-buffer pass computes on the GPU."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from deferred_ir.base.arrays import Array, Ints
from deferred_ir.base.colour import srgb_table
from deferred_ir.scene.geometry import Geometry
from deferred_ir.scene.materials import Material, Texture


def look_up_albedo(
    geometry: Geometry, materials: Sequence[Material], textures: Sequence[Texture], faces: Ints, weights: Array
) -> Array:
    """Return the linear RGB reflectance, float64 (n, 3), at points of `faces` (n,) by barycentric `weights` (n, 3).

    It is the material's albedo times vertex colour times texture, as in the rasteriser.
    """
    numbers = geometry.face_materials[faces]
    result: Array = np.array([material.albedo for material in materials], dtype=np.float64)[numbers]
    if geometry.colors is not None:
        blend = np.asarray(weights, dtype=np.float64)[..., None]
        result *= (geometry.colors[geometry.faces[faces]] * blend).sum(axis=1)
    wanted = [material.texture for material in materials]
    return _multiply_textures(result, geometry, _choose_textures(wanted, textures), faces, weights)


def look_up_emission(
    geometry: Geometry, materials: Sequence[Material], textures: Sequence[Texture], faces: Ints, weights: Array
) -> Array:
    """Return the radiance emitted from the sides that shine, float64 (n, 3); arguments as in `look_up_albedo`."""
    numbers = geometry.face_materials[faces]
    result: Array = np.array([material.emission for material in materials], dtype=np.float64)[numbers]
    wanted = [material.emission_texture for material in materials]
    return _multiply_textures(result, geometry, _choose_textures(wanted, textures), faces, weights)


def _choose_textures(numbers: Sequence[int | None], textures: Sequence[Texture]) -> list[Texture | None]:
    return [None if number is None else textures[number] for number in numbers]


def _multiply_textures(
    colours: Array, geometry: Geometry, textures: Sequence[Texture | None], faces: Ints, weights: Array
) -> Array:
    """Return `colours` (n, 3) times the textures, one or none for each material, at points of faces."""
    if geometry.uvs is None or not any(textures):
        return colours
    numbers = geometry.face_materials[faces]
    for number in np.unique(numbers):
        texture = textures[number]
        if texture is not None:
            rows = numbers == number
            blend = np.asarray(weights[rows], dtype=np.float64)[..., None]
            uvs = (geometry.uvs[geometry.faces[faces[rows]]] * blend).sum(axis=1)
            colours[rows] *= sample_texture(texture, uvs)
    return colours


def sample_texture(texture: Texture, uvs: Array) -> Array:
    """Return a texture's linear RGB at `uvs` (n, 2), float64 (n, 3): decoded, then filtered bilinearly.

    Coordinates repeat as in OpenGL: texel centres lie at (i + 0.5) / width, v = 1 is the top edge.
    """
    height, width = texture.pixels.shape[:2]
    u, v = np.asarray(uvs, dtype=np.float64).T
    x = (u - np.floor(u)) * width - 0.5
    y = (1 - (v - np.floor(v))) * height - 0.5
    left, top = np.floor(x).astype(np.int64), np.floor(y).astype(np.int64)
    right, bottom = (left + 1) % width, (top + 1) % height
    across, down = (x - left)[:, None], (y - top)[:, None]
    left, top = left % width, top % height
    table = srgb_table().astype(np.float64)
    upper, lower = (
        table[texture.pixels[row, left]] * (1 - across) + table[texture.pixels[row, right]] * across
        for row in (top, bottom)
    )
    result: Array = upper * (1 - down) + lower * down
    return result
