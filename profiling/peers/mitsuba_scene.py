"""Conversion of a scene to the dictionary from which Mitsuba loads its own.

`mitsuba_lights` converts the lights and `mitsuba_materials` the materials.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from deferred_ir.base.arrays import Bools, Ints
from deferred_ir.base.errors import SettingError
from deferred_ir.frame.frame import NEAR
from deferred_ir.profiling.peers.mitsuba_lights import convert_lights
from deferred_ir.profiling.peers.mitsuba_materials import describe_image, describe_material
from deferred_ir.profiling.peers.peer import check_materials
from deferred_ir.scene.scene import Scene
from deferred_ir.truth.path_tracer import MOST_REFLECTIONS

SAMPLER = "multijitter"
FAR = 1e3
"""Far plane, as a multiple of the distance that the camera has to see."""
APART = 1e-5
"""How far behind a triangle that emits from both sides its back stands, in diagonals: Mitsuba's shine to one side."""


def describe(mi: Any, scene: Scene, size: tuple[int, int], bounces: int) -> dict[str, Any]:
    """Return the input of `mitsuba.load_dict`. mi: mitsuba with a variant set. Raises SettingError for other scenes."""
    check_materials("mitsuba", scene)
    shapes = {
        f"mesh_{number}_{smooth}": _mesh(mi, scene, number, faces, smooth=smooth)
        for number in range(len(scene.materials))
        for smooth, faces in _split(scene, np.flatnonzero(scene.geometry.face_materials == number))
    }
    shapes |= {
        f"back_{number}": _mesh(mi, scene, number, np.flatnonzero(scene.geometry.face_materials == number), back=True)
        for number, material in enumerate(scene.materials)
        if material.emits_both_sides and any(material.emission) and (scene.geometry.face_materials == number).any()
    }
    # A path of `bounces` has a segment to the camera, one for each bounce, and one to the light. Reflections are more
    # of them: Mitsuba does not tell them from bounces, so where both are there it shows more of both, and caustics.
    integrator = {"type": "path", "max_depth": bounces + 2 + (MOST_REFLECTIONS if scene.has_gloss else 0)}
    sensor = _sensor(mi, scene, size)
    return {"type": "scene", "integrator": integrator, "sensor": sensor, **convert_lights(mi, scene), **shapes}


def _sensor(mi: Any, scene: Scene, size: tuple[int, int]) -> dict[str, Any]:
    camera, geometry = scene.camera, scene.geometry
    reach = geometry.diagonal + float(np.abs(geometry.bounds - np.asarray(camera.position)).max())
    return {
        "type": "perspective",
        "fov": camera.fov,
        "fov_axis": "y",
        "near_clip": NEAR * geometry.scale,
        "far_clip": FAR * reach,
        "to_world": mi.ScalarTransform4f().look_at(
            origin=list(camera.position), target=list(camera.look_at), up=list(camera.up)
        ),
        "film": {
            "type": "hdrfilm",
            "width": size[0],
            "height": size[1],
            "pixel_format": "rgb",
            "component_format": "float32",
            "rfilter": {"type": "box"},
        },
        "sampler": {"type": SAMPLER},
    }


def _split(scene: Scene, faces: Ints) -> list[tuple[bool, Ints]]:
    """Split `faces` into those without and with shading normals of the file; empty ones are left out."""
    geometry = scene.geometry
    smooth: Bools = np.zeros(len(faces), np.bool_)
    if geometry.normals is not None:
        smooth |= (geometry.normals[geometry.faces[faces]] != 0).any(axis=(1, 2))
    parts = [(False, faces[~smooth]), (True, faces[smooth])]
    return [(kind, part) for kind, part in parts if len(part)]


def _mesh(mi: Any, scene: Scene, number: int, faces: Ints, *, smooth: bool = False, back: bool = False) -> Any:
    """Build a mesh of the triangles `faces`, all of material `number`; or of their backs, flat, a little behind."""
    geometry, material = scene.geometry, scene.materials[number]
    if back:
        used, corners = geometry.faces[faces].ravel(), np.arange(3 * len(faces)).reshape(-1, 3)[:, ::-1].ravel()
        behind = np.repeat(geometry.face_normals[faces], 3, axis=0) * (APART * geometry.diagonal)
    else:
        used, corners = np.unique(geometry.faces[faces], return_inverse=True)
        behind = np.zeros((len(used), 3))
    textured = any(material.textures.values()) and geometry.uvs is not None
    colors = None if geometry.colors is None else geometry.colors[used]
    if colors is not None and (colors == colors[0]).all():
        albedo, colors = np.multiply(material.base_color, colors[0]), None
    else:
        albedo = np.asarray(material.base_color)
    if material.base_color_texture is not None and geometry.uvs is not None and colors is not None:
        raise SettingError(
            f"mitsuba: cannot multiply the vertex colours of '{material.name}' by its image texture, as this scene does"
        )
    properties = mi.Properties()
    properties["bsdf"] = mi.load_dict(describe_material(mi, scene, material, albedo, colors))
    if any(material.emission):
        radiance = describe_image(mi, scene, material.emission_texture, np.asarray(material.emission))
        properties["emitter"] = mi.load_dict({"type": "area", "radiance": radiance})
    mesh = mi.Mesh(
        material.name,
        vertex_count=len(used),
        face_count=len(faces),
        has_vertex_normals=smooth,
        has_vertex_texcoords=textured,
        props=properties,
    )
    if colors is not None:
        mesh.add_attribute("vertex_color", 3, np.ravel(colors * albedo).astype(np.float32))
    values = {"vertex_positions": geometry.positions[used] - behind, "faces": corners.astype(np.uint32)}
    if smooth and geometry.normals is not None:
        values["vertex_normals"] = geometry.normals[used]
    if textured and geometry.uvs is not None:
        values["vertex_texcoords"] = geometry.uvs[used] * (1, -1) + (0, 1)  # its v runs down the image
    parameters = mi.traverse(mesh)
    for name, array in values.items():
        kind = np.uint32 if name == "faces" else np.float32
        parameters[name] = np.ravel(array).astype(kind)
    parameters.update()
    return mesh
