"""What is cut out of surfaces, for shaders: alpha of the materials' images, and the triangles that have holes.

Maps draw these triangles apart from the rest, with vertices of their own: where in the image each corner lies.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from deferred_ir.base.arrays import Array, Ints
from deferred_ir.meshes.posed import MapMesh
from deferred_ir.scene.geometry import Geometry
from deferred_ir.scene.scene import Scene
from deferred_ir.scene.surfaces.materials import Material, TextureRef
from deferred_ir.scene.surfaces.texture_lookup import find_uvs, has_uvs

COVERAGES, TEXELS = 6, 7
"""Bindings of the storage buffers of lib/surface/coverage.glsl."""
WRAPS = ("repeat", "mirror", "clamp")


def pack_coverage(scene: Scene) -> dict[int, Array]:
    """Return the tables of lib/surface/coverage.glsl by their bindings, none for a scene without holes."""
    if not scene.has_cutouts:
        return {}
    rows, words = [], [np.zeros(1, "u4")]
    first: dict[int, int] = {}
    for material in scene.materials:
        texture = _find_image(scene, material)
        row = [material.alpha, -1.0 if material.alpha_cutoff is None else material.alpha_cutoff, -1.0, 0.0, 1, 1, 0, 0]
        if texture is not None:
            pixels = scene.textures[texture.number].pixels
            if texture.number not in first:
                first[texture.number] = sum(map(len, words))
                words.append(_pack_alpha(pixels))
            height, width = pixels.shape[:2]
            sampler = texture.sampler
            wraps = [WRAPS.index(wrap) for wrap in sampler.wrap]
            row[2:] = [first[texture.number], float(sampler.magnify == "nearest"), width, height, *wraps]
        rows.append(row)
    return {COVERAGES: np.array(rows, "f4"), TEXELS: np.concatenate(words)}


def _find_image(scene: Scene, material: Material) -> TextureRef | None:
    """Return the image that says what of a material is there, if one does."""
    texture = material.base_color_texture
    if texture is None or not material.is_cut or not has_uvs(scene.geometry, texture):
        return None
    return texture if scene.textures[texture.number].pixels.shape[2] > 3 else None


def _pack_alpha(pixels: Array) -> Array:
    """Pack the alpha of an image, row by row from the top, four bytes a word."""
    alpha = pixels[..., 3]
    eight = alpha if alpha.dtype == np.uint8 else np.round(alpha / 257).astype(np.uint8)
    flat = np.zeros(-(-eight.size // 4) * 4, np.uint8)
    flat[: eight.size] = eight.ravel()
    return flat.view("<u4")


def list_cut_faces(scene: Scene) -> Ints:
    """Return the faces that may have holes, model by model, int (n,)."""
    cut = np.array([material.is_cut for material in scene.materials], bool)[scene.geometry.face_materials]
    faces = np.flatnonzero(cut)
    return faces[np.argsort(scene.geometry.groups[faces], kind="stable")]


def make_cut_mesh(geometry: Geometry, faces: Ints) -> MapMesh:
    """Make the mesh of `faces` (n,), those of a model in a row, each with three vertices of its own."""
    rest = geometry.rest
    ends = 3 * np.searchsorted(rest.groups[faces], np.arange(len(rest.moving) + 2))
    moving = tuple(slice(int(a), int(b)) for a, b in pairwise(ends[1:]))
    positions = rest.positions[rest.faces[faces].ravel()]
    return MapMesh(positions, np.arange(len(positions)).reshape(-1, 3), moving)


def place_corners(scene: Scene, faces: Ints) -> Array:
    """Return where the corners of `faces` (n,) are in their images, u and v, and their material, float32 (3 n, 3)."""
    geometry = scene.geometry
    corners = np.zeros((len(faces), 3, 3), np.float32)
    numbers = geometry.face_materials[faces]
    corners[..., 2] = numbers[:, None]
    for number in np.unique(numbers):
        texture = _find_image(scene, scene.materials[number])
        if texture is not None:
            rows = np.flatnonzero(numbers == number)
            for corner in range(3):
                weights = np.tile(np.eye(3)[corner], (len(rows), 1))
                corners[rows, corner, :2] = find_uvs(geometry, texture, faces[rows], weights)
    return corners.reshape(-1, 3)
