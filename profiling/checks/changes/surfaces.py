"""Changes of a scene's normals, colours and textures for the extreme cases. Each takes a scene, returns another."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from deferred_ir.base.arrays import Array
from deferred_ir.loading.models import move_uvs_home
from deferred_ir.profiling.checks.changes.triangles import with_geometry
from deferred_ir.profiling.checks.changes.views import brighten, put_camera_at_wall
from deferred_ir.scene.scene import Scene
from deferred_ir.scene.surfaces.materials import Texture, TextureRef

GREY = 188
"""An sRGB value, about one half in linear light."""


def with_albedo(scene: Scene, albedo: float) -> Scene:
    """Give all surfaces one reflectance, without textures and colours."""
    materials = tuple(
        replace(material, base_color=(albedo,) * 3, base_color_texture=None) for material in scene.materials
    )
    return with_geometry(replace(scene, materials=materials, textures=()), colors=None, uvs=None)


def _separate_faces(scene: Scene, normals: Array | None) -> Scene:
    """Give each face vertices of its own. normals: shading normals of the corners, (3 F, 3), None for none."""
    g = scene.geometry
    corners = g.faces.ravel()
    return with_geometry(
        scene,
        positions=g.positions[corners],
        faces=np.arange(len(corners), dtype=np.int32).reshape(-1, 3),
        normals=None if normals is None else normals.astype(np.float32),
        uvs=None if g.uvs is None else g.uvs[corners],
        colors=None if g.colors is None else g.colors[corners],
        second_uvs=None if g.second_uvs is None else g.second_uvs[corners],
        tangents=None if g.tangents is None else g.tangents[corners],
    )


def remove_normals(scene: Scene) -> Scene:
    """Remove the shading normals."""
    return _separate_faces(scene, None)


def with_normals(scene: Scene, value: float) -> Scene:
    """Set all components of the shading normals to `value`."""
    return _separate_faces(scene, np.full((scene.geometry.faces.size, 3), value))


def reverse_normals(scene: Scene) -> Scene:
    """Set the shading normals to the reverse of the faces' normals."""
    return _separate_faces(scene, -np.repeat(scene.geometry.face_normals, 3, axis=0))


def paint_grey(scene: Scene) -> Scene:
    """Give all surfaces the grey of `texture_grey`, without a texture."""
    from deferred_ir.base.colour import srgb_table

    return with_albedo(scene, float(srgb_table()[GREY].astype(np.float16)))


def texture_grey(scene: Scene, size: int) -> Scene:
    """Make all surfaces grey by a texture of size x size texels."""
    return _with_texture(scene, np.full((size, size, 3), GREY, np.uint8), 0.0)


def texture_grey_finely(scene: Scene) -> Scene:
    """Make all surfaces grey by a texture of 16 bits."""
    return _with_texture(scene, np.full((4, 4, 3), GREY * 257, np.uint16), 0.0)


def with_gloss(scene: Scene, **numbers: float) -> Scene:
    """Change numbers of all materials, which have a full coat unless these say otherwise."""
    changed: dict[str, Any] = {"specular": 1.0, **numbers}
    return replace(scene, materials=tuple(replace(material, **changed) for material in scene.materials))


def turn_to_black_metal(scene: Scene) -> Scene:
    """Make all surfaces metals that reflect nothing head-on."""
    return with_gloss(with_albedo(scene, 0.0), metallic=1.0, roughness=0.3)


def bend_normals(scene: Scene, x: float, z: float) -> Scene:
    """Give all surfaces a normal map of one texel, (x, 0, z)."""
    texel = np.round((np.array([[[x, 0.0, z]]]) + 1) * 32767.5).astype(np.uint16)
    number = len(scene.textures)
    normal = TextureRef(number)
    materials = tuple(replace(material, normal_texture=normal, specular=1.0) for material in scene.materials)
    g = scene.geometry
    along = np.where(np.abs(g.face_normals[:, :1]) < 0.9, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    along = along - (along * g.face_normals).sum(axis=1, keepdims=True) * g.face_normals
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    apart = _separate_faces(scene, None)
    tangents = np.column_stack([np.repeat(along, 3, axis=0), np.ones(3 * len(g.faces))]).astype(np.float32)
    uvs = apart.geometry.uvs if apart.geometry.uvs is not None else np.zeros((len(tangents), 2), np.float32)
    bent = replace(apart, materials=materials, textures=(*scene.textures, Texture("bent", texel)))
    return with_geometry(bent, tangents=tangents, uvs=uvs)


def coat_white(scene: Scene, roughness: float) -> Scene:
    """Make all surfaces white below a coat."""
    return with_gloss(with_albedo(scene, 1.0), roughness=roughness)


def look_along_coated_wall(scene: Scene, off: float) -> Scene:
    """Coat all surfaces, and look along a wall."""
    return with_gloss(put_camera_at_wall(scene, fraction=off, along=True), roughness=0.2)


def brighten_coated(scene: Scene, factor: float) -> Scene:
    """Coat all surfaces, and make lights `factor` times as bright."""
    return with_gloss(brighten(scene, factor), roughness=0.4)


def without_map(scene: Scene) -> Scene:
    """Make the scene of `bend_normals` without the map: faces with a coat, and no shading normals."""
    return with_gloss(remove_normals(scene))


def texture_checkers(scene: Scene, shift: float = 0.0) -> Scene:
    """Give all surfaces a texture of 8x8 random greys. shift: the coordinates, as in a file, start there."""
    greys = np.random.default_rng(3).integers(60, 250, (8, 8, 1))
    return _with_texture(scene, np.repeat(greys, 3, axis=2).astype(np.uint8), shift)


def _with_texture(scene: Scene, pixels: Array, shift: float) -> Scene:
    plain = with_albedo(scene, 1.0)
    uvs = move_uvs_home(
        (plain.geometry.positions - plain.geometry.bounds[0])[:, :2] / plain.geometry.diagonal + shift, [TextureRef(0)]
    )
    paper = replace(
        plain,
        materials=tuple(replace(material, base_color_texture=TextureRef(0)) for material in plain.materials),
        textures=(Texture("paper", pixels),),
    )
    return with_geometry(paper, uvs=uvs.astype(np.float32))
