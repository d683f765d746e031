"""Conversion of a scene to the dictionary from which Mitsuba loads its own."""

from __future__ import annotations

from typing import Any

import numpy as np

from deferred_ir.base.arrays import Array, Bools, Ints
from deferred_ir.base.colour import srgb_table
from deferred_ir.base.errors import SettingError
from deferred_ir.frame.frame import NEAR
from deferred_ir.scene.lights.spotlight import Spotlight, one_minus_cos
from deferred_ir.scene.materials import Material
from deferred_ir.scene.scene import Scene

SAMPLER = "multijitter"
CONE_TEXELS = (1024, 4096)
"""Least and most texels along an edge of the projected texture."""
CONE_STEP = 0.1
"""Largest step between texels, as a tangent; linear interpolation then errs by at most 0.13 % on the axis."""
FAR = 1e3
"""Far plane, as a multiple of the distance that the camera has to see."""


def describe(mi: Any, scene: Scene, size: tuple[int, int], bounces: int) -> dict[str, Any]:
    """Return the input of `mitsuba.load_dict`. mi: mitsuba with a variant set. Raises SettingError for other scenes."""
    shapes = {
        f"mesh_{number}_{smooth}": _mesh(mi, scene, number, faces, smooth=smooth)
        for number in range(len(scene.materials))
        for smooth, faces in _split(scene, np.flatnonzero(scene.geometry.face_materials == number))
    }
    # A path of `bounces` has a segment to the camera, one for each bounce, and one to the light.
    integrator = {"type": "path", "max_depth": bounces + 2}
    sensor = _sensor(mi, scene, size)
    return {"type": "scene", "integrator": integrator, "sensor": sensor, "light": _spot(mi, scene.spotlight), **shapes}


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


def _spot(mi: Any, light: Spotlight) -> dict[str, Any]:
    if light.radius > 0:
        raise SettingError("mitsuba: its spotlight has no radius, and this scene's has; leave it out by --peers")
    up = np.eye(3)[np.abs(light.axis).argmin()]
    origin = np.asarray(light.position, float)
    return {
        "type": "spot",
        "to_world": mi.ScalarTransform4f().look_at(
            origin=origin.tolist(), target=(origin + light.axis).tolist(), up=up.tolist()
        ),
        "intensity": {"type": "rgb", "value": list(light.emission)},
        "cutoff_angle": light.fov / 2,
        "beam_width": light.fov / 2,  # no falloff of its own
        "texture": _bitmap(mi, _profile(light)[..., None], wrap="clamp"),
    }


def _profile(light: Spotlight) -> Array:
    """Return cos(theta) cone(theta) over the light's image plane up to tan(fov/2), float32 (n, n)."""
    tangent = np.tan(np.radians(light.fov) / 2)
    least, most = CONE_TEXELS
    texels = least
    while 2 * tangent / texels > CONE_STEP:
        texels *= 2
        if texels > most:
            raise SettingError(
                f"mitsuba: a spotlight of {light.fov:g} degrees is too wide for the texture that it projects"
            )
    x = ((np.arange(texels) + 0.5) / texels * 2 - 1) * tangent
    cosine = 1 / np.sqrt(1 + x[:, None] ** 2 + x**2)
    off_axis, edge = (x[:, None] ** 2 + x**2) * cosine**2 / (1 + cosine), one_minus_cos(light.fov)
    profile: Array = (cosine * np.clip(4 * (edge - off_axis) / edge, 0, 1)).astype(np.float32)
    return profile


def _split(scene: Scene, faces: Ints) -> list[tuple[bool, Ints]]:
    """Split `faces` into those without and with shading normals of the file; empty ones are left out."""
    geometry = scene.geometry
    smooth: Bools = np.zeros(len(faces), np.bool_)
    if geometry.normals is not None:
        smooth |= (geometry.normals[geometry.faces[faces]] != 0).any(axis=(1, 2))
    parts = [(False, faces[~smooth]), (True, faces[smooth])]
    return [(kind, part) for kind, part in parts if len(part)]


def _mesh(mi: Any, scene: Scene, number: int, faces: Ints, *, smooth: bool) -> Any:
    """Build a mesh of the triangles `faces`, all of material `number`."""
    geometry, material = scene.geometry, scene.materials[number]
    used, corners = np.unique(geometry.faces[faces], return_inverse=True)
    textured = material.texture is not None and geometry.uvs is not None
    colors = None if geometry.colors is None else geometry.colors[used]
    if colors is not None and (colors == colors[0]).all():
        albedo, colors = np.multiply(material.albedo, colors[0]), None
    else:
        albedo = np.asarray(material.albedo)
    if textured and colors is not None:
        raise SettingError(
            f"mitsuba: cannot multiply the vertex colours of '{material.name}' by its image texture, as this scene does"
        )
    properties = mi.Properties()
    properties["bsdf"] = mi.load_dict(
        {
            "type": "twosided",
            "bsdf": {"type": "diffuse", "reflectance": _reflectance(mi, scene, material, albedo, colors)},
        }
    )
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
    values = {"vertex_positions": geometry.positions[used], "faces": corners.astype(np.uint32)}
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


def _reflectance(mi: Any, scene: Scene, material: Material, albedo: Array, colors: Array | None) -> dict[str, Any]:
    if colors is not None:
        return {"type": "mesh_attribute", "name": "vertex_color"}
    if material.texture is None or scene.geometry.uvs is None:
        return {"type": "rgb", "value": albedo.tolist()}
    # Linear before filtering, as ours; the filter is linear, so the albedo can be in its pixels.
    return _bitmap(mi, srgb_table()[scene.textures[material.texture].pixels] * albedo.astype(np.float32))


def _bitmap(mi: Any, pixels: Array, wrap: str = "repeat") -> dict[str, Any]:
    """Return a texture of linear values, float32 (H, W, 1 or 3)."""
    bitmap = mi.Bitmap(np.ascontiguousarray(pixels, np.float32))
    return {"type": "bitmap", "bitmap": bitmap, "raw": True, "filter_type": "bilinear", "wrap_mode": wrap}
