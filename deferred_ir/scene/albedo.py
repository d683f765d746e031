"""Reflectance at points of a scene's surfaces: what the G-buffer pass computes on the GPU."""

from __future__ import annotations

import numpy as np

from deferred_ir.base.arrays import Array, Ints
from deferred_ir.base.colour import srgb_table
from deferred_ir.scene.scene import Scene, Texture


def look_up_albedo(scene: Scene, faces: Ints, weights: Array) -> Array:
    """Return the linear RGB reflectance, float64 (n, 3), at points of `faces` (n,) by barycentric `weights` (n, 3).

    It is the material's albedo times vertex colour times texture, as in the rasteriser.
    """
    geometry = scene.geometry
    materials = geometry.face_materials[faces]
    result: Array = np.array([material.albedo for material in scene.materials], dtype=np.float64)[materials]
    corners = geometry.faces[faces]
    blend = np.asarray(weights, dtype=np.float64)[..., None]
    if geometry.colors is not None:
        result *= (geometry.colors[corners] * blend).sum(axis=1)
    if geometry.uvs is None:
        return result
    textures = np.array([-1 if material.texture is None else material.texture for material in scene.materials])
    for index in np.unique(textures[materials]):
        if index >= 0:
            rows = textures[materials] == index
            uvs = (geometry.uvs[corners[rows]] * blend[rows]).sum(axis=1)
            result[rows] *= sample_texture(scene.textures[index], uvs)
    return result


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
