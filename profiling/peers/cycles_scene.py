"""Conversion of a scene to Blender's: one mesh, its materials, and the camera; `cycles_lights` converts the lights."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from deferred_ir.base.arrays import Array, Vec3
from deferred_ir.profiling.peers.cycles_lights import convert_lights
from deferred_ir.profiling.peers.cycles_nodes import Nodes, make_matrix
from deferred_ir.profiling.peers.peer import check_materials, decode, find_numbers
from deferred_ir.scene.camera import Camera
from deferred_ir.scene.geometry import Geometry
from deferred_ir.scene.scene import Scene
from deferred_ir.scene.surfaces.materials import WHITE, Material, TextureRef

FARTHEST = 10.0
"""Far plane, in distances from the camera to the farthest corner of the scene."""


def build(bpy: Any, scene: Scene) -> None:
    """Fill Blender's empty scene. Its axes are used as ours, since nothing depends on which way is up."""
    link = bpy.context.scene.collection.objects.link
    check_materials("cycles", scene)
    images = [_image(bpy, texture.name, decode(texture)) for texture in scene.textures]
    mesh = _mesh(bpy, scene.geometry)
    for material in scene.materials:
        mesh.materials.append(_material(bpy, scene, material, images))
    body = bpy.data.objects.new("scene", mesh)
    # By default Blender lifts shadow rays off smooth surfaces, against visible facets.
    body.shadow_terminator_geometry_offset = body.shadow_terminator_shading_offset = 0
    link(body)
    for light in convert_lights(bpy, scene):
        link(light)
    camera = _camera(bpy, scene.camera, scene.geometry)
    link(camera)
    bpy.context.scene.camera = camera


def _mesh(bpy: Any, geometry: Geometry) -> Any:
    """Build a mesh with a vertex for each corner: Cycles takes a file's normals from vertices, not from corners."""
    mesh = bpy.data.meshes.new("scene")
    corners = geometry.faces.ravel()
    mesh.vertices.add(len(corners))
    mesh.vertices.foreach_set("co", geometry.positions[corners].astype(np.float32).ravel())
    mesh.loops.add(len(corners))
    mesh.loops.foreach_set("vertex_index", np.arange(len(corners), dtype=np.int32))
    mesh.polygons.add(len(geometry.faces))
    mesh.polygons.foreach_set("loop_start", np.arange(0, len(corners), 3, dtype=np.int32))
    mesh.polygons.foreach_set("material_index", geometry.face_materials)
    mesh.polygons.foreach_set("use_smooth", np.full(len(geometry.faces), geometry.normals is not None))
    mesh.update(calc_edges=True)
    if geometry.uvs is not None:
        _attribute(mesh, "uv", "FLOAT2", "CORNER", geometry.uvs[corners])
    if geometry.colors is not None:
        opaque = np.column_stack([geometry.colors, np.ones(len(geometry.colors))])
        # Cycles reads zeros from an attribute that is called "color".
        _attribute(mesh, "tint", "FLOAT_COLOR", "POINT", opaque[corners])
    if geometry.normals is not None:
        normals = _corner_normals(geometry, geometry.normals)
        _attribute(mesh, "custom_normal", "FLOAT_VECTOR", "POINT", normals)
    return mesh


def _corner_normals(geometry: Geometry, normals: Array) -> Array:
    """Return the shading normals of the faces' corners (3F, 3), turned into the hemisphere of the face's normal."""
    flat = np.repeat(geometry.face_normals, 3, axis=0)
    own = normals[geometry.faces.ravel()].astype(np.float64)
    side = np.where((own * flat).sum(axis=1) < 0, -1.0, 1.0)
    return np.where(own.any(axis=1, keepdims=True), own * side[:, None], flat)


def _attribute(mesh: Any, name: str, kind: str, domain: str, values: Array) -> None:
    attribute = mesh.attributes.new(name, kind, domain)
    attribute.data.foreach_set("color" if kind == "FLOAT_COLOR" else "vector", values.astype(np.float32).ravel())


def _image(bpy: Any, name: str, linear: Array) -> Any:
    """Build an image of linear floats (H, W, 3): Cycles would decode sRGB after filtering, and we decode before."""
    height, width = linear.shape[:2]
    image = bpy.data.images.new(name, width, height, alpha=False, float_buffer=True, is_data=True)
    pixels = np.ones((height, width, 4), np.float32)
    pixels[..., :3] = linear[::-1]
    image.pixels.foreach_set(pixels.ravel())
    return image


def _material(bpy: Any, scene: Scene, material: Material, images: Sequence[Any]) -> Any:
    """Build a material with reflectance = base colour * texture * vertex colour, which may emit."""
    result = bpy.data.materials.new(material.name)
    result.use_nodes = True
    nodes = Nodes(result.node_tree)
    reflectance = _textured(nodes, material.base_color, _find_image(material.base_color_texture, images))
    if scene.geometry.colors is not None:
        color = nodes.add("ShaderNodeAttribute")
        color.attribute_name = "tint"
        reflectance = nodes.vector("MULTIPLY", reflectance, color.outputs["Color"])
    surface = _glossy(bpy, nodes, scene, material, reflectance) if material.is_glossy else _matt(nodes, reflectance)
    if any(material.emission):
        radiance = _textured(nodes, material.emission, _find_image(material.emission_texture, images))
        emission = nodes.add("ShaderNodeEmission", Color=radiance)
        if not material.emits_both_sides:
            behind = nodes.add("ShaderNodeNewGeometry").outputs["Backfacing"]
            nodes.join(nodes.math(behind, -1.0, 1.0), emission.inputs["Strength"])
        both = nodes.add("ShaderNodeAddShader")
        nodes.join(surface, both.inputs[0])
        nodes.join(emission.outputs["Emission"], both.inputs[1])
        surface = both.outputs["Shader"]
        result.cycles.emission_sampling = "FRONT_BACK" if material.emits_both_sides else "FRONT"
    nodes.join(surface, nodes.add("ShaderNodeOutputMaterial").inputs["Surface"])
    return result


def _matt(nodes: Nodes, reflectance: Any) -> Any:
    return nodes.add("ShaderNodeBsdfDiffuse", Roughness=0.0, Color=reflectance).outputs["BSDF"]


def _glossy(bpy: Any, nodes: Nodes, scene: Scene, material: Material, color: Any) -> Any:
    """Add Blender's principled BSDF, with light that facets scatter once, as ours.

    A metal differs by its shadowing, which goes with the heights of facets for both directions together. Under a coat,
    what the coat reflects on average is taken from the diffuse part, and the coat has a dielectric's exact Fresnel
    term.
    """
    principled = nodes.add("ShaderNodeBsdfPrincipled")
    principled.distribution = "GGX"
    inputs = principled.inputs
    nodes.join(color, inputs["Base Color"])
    nodes.join(float(max(material.ior, 1.0)), inputs["IOR"])
    nodes.join(material.specular / 2, inputs["Specular IOR Level"])
    nodes.join((*material.specular_color, 1.0), inputs["Specular Tint"])
    numbers = (("Roughness", material.roughness), ("Metallic", material.metallic))
    image = find_numbers(scene, material)
    parts: tuple[Any, ...] = (None, None)
    if image is not None:
        pixels = np.concatenate([image, np.ones((*image.shape[:2], 1), np.float32)], axis=2)
        split = nodes.add("ShaderNodeSeparateXYZ", Vector=_textured(nodes, WHITE, _image(bpy, material.name, pixels)))
        parts = split.outputs[0], split.outputs[1]
    for (name, factor), part in zip(numbers, parts, strict=True):
        nodes.join(factor if part is None else nodes.math(part, factor, 0.0), inputs[name])
    return principled.outputs["BSDF"]


def _find_image(texture: TextureRef | None, images: Sequence[Any]) -> Any:
    return None if texture is None else images[texture.number]


def _textured(nodes: Nodes, factor: Vec3, image: Any) -> Any:
    """Return a colour times an image, if there is one, as a socket."""
    constant = nodes.value(factor)
    if image is None:
        return constant
    where = nodes.add("ShaderNodeUVMap")
    where.uv_map = "uv"
    lookup = nodes.add("ShaderNodeTexImage", Vector=where.outputs["UV"])
    lookup.image, lookup.interpolation, lookup.extension = image, "Linear", "REPEAT"
    return nodes.vector("MULTIPLY", constant, lookup.outputs["Color"])


def _camera(bpy: Any, camera: Camera, geometry: Geometry) -> Any:
    lens = bpy.data.cameras.new("camera")
    tangent = np.tan(np.radians(camera.fov) / 2)
    lens.sensor_fit = "VERTICAL"
    lens.sensor_height = max(24.0, 2 * tangent)  # Blender has no focal length below 1 mm
    lens.lens = lens.sensor_height / (2 * tangent)
    farthest = np.abs(geometry.bounds - camera.position).max(axis=0)
    lens.clip_start = 1e-4 * geometry.diagonal
    lens.clip_end = FARTHEST * float(np.linalg.norm(farthest))
    body = bpy.data.objects.new("camera", lens)
    right, up, forward = camera.axes
    body.matrix_world = make_matrix(right, up, -forward, camera.position)
    return body
