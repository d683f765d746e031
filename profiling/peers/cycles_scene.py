"""Conversion of a scene to Blender's: one mesh, its materials, the camera, and the spotlight as nodes."""

from __future__ import annotations

from typing import Any

import numpy as np

from deferred_ir.base.arrays import Array, Vec3
from deferred_ir.base.colour import srgb_table
from deferred_ir.sampling.warps import build_basis
from deferred_ir.scene.camera import Camera
from deferred_ir.scene.geometry import Geometry
from deferred_ir.scene.lights.spotlight import Spotlight, one_minus_cos
from deferred_ir.scene.materials import Material, Texture
from deferred_ir.scene.scene import Scene

POINT_POWER = 4 * np.pi
"""Power in watts at which Blender's point light has 1 W/sr for each unit of its nodes' emission."""
DISC_POWER = np.pi
"""Power in watts at which Blender's disc light has the same along its axis."""
FARTHEST = 10.0
"""Far plane, in distances from the camera to the farthest corner of the scene."""


def build(bpy: Any, scene: Scene) -> None:
    """Fill Blender's empty scene. Its axes are used as ours, since nothing depends on which way is up."""
    link = bpy.context.scene.collection.objects.link
    images = [_image(bpy, texture) for texture in scene.textures]
    mesh = _mesh(bpy, scene.geometry)
    for material in scene.materials:
        image = None if material.texture is None else images[material.texture]
        mesh.materials.append(_material(bpy, material, image, scene.geometry.colors is not None))
    body = bpy.data.objects.new("scene", mesh)
    # By default Blender lifts shadow rays off smooth surfaces, against visible facets.
    body.shadow_terminator_geometry_offset = body.shadow_terminator_shading_offset = 0
    link(body)
    link(_light(bpy, scene.spotlight))
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


def _image(bpy: Any, texture: Texture) -> Any:
    """Build an image of linear floats: Cycles would decode sRGB after filtering, and we decode before."""
    height, width, _ = texture.pixels.shape
    image = bpy.data.images.new(texture.name, width, height, alpha=False, float_buffer=True, is_data=True)
    pixels = np.ones((height, width, 4), np.float32)
    pixels[..., :3] = srgb_table()[texture.pixels[::-1]]
    image.pixels.foreach_set(pixels.ravel())
    return image


def _material(bpy: Any, material: Material, image: Any, colored: bool) -> Any:
    """Build a diffuse material with reflectance = albedo * texture * vertex colour."""
    result = bpy.data.materials.new(material.name)
    result.use_nodes = True
    nodes = _Nodes(result.node_tree)
    diffuse = nodes.add("ShaderNodeBsdfDiffuse", Roughness=0.0)
    reflectance = nodes.value(material.albedo)
    if image is not None:
        where = nodes.add("ShaderNodeUVMap")
        where.uv_map = "uv"
        lookup = nodes.add("ShaderNodeTexImage", Vector=where.outputs["UV"])
        lookup.image, lookup.interpolation, lookup.extension = image, "Linear", "REPEAT"
        reflectance = nodes.vector("MULTIPLY", reflectance, lookup.outputs["Color"])
    if colored:
        color = nodes.add("ShaderNodeAttribute")
        color.attribute_name = "tint"
        reflectance = nodes.vector("MULTIPLY", reflectance, color.outputs["Color"])
    nodes.join(reflectance, diffuse.inputs["Color"])
    nodes.join(diffuse.outputs["BSDF"], nodes.add("ShaderNodeOutputMaterial").inputs["Surface"])
    return result


def _light(bpy: Any, spotlight: Spotlight) -> Any:
    """Build a point light or a disc. The nodes give the cone and a point's cosine; a disc has the cosine by itself."""
    point = spotlight.radius == 0
    light = bpy.data.lights.new("spotlight", "POINT" if point else "AREA")
    if point:
        light.energy, light.shadow_soft_size = POINT_POWER, 0
    else:
        light.energy, light.shape, light.size = DISC_POWER, "DISK", 2 * spotlight.radius
    # A ray that meets the disc by chance would see it; ours pass.
    light.cycles.use_multiple_importance_sampling = False
    light.use_nodes = True
    nodes = _Nodes(light.node_tree)
    # w from the light; 1 - cos(theta) = |w - axis|^2 / 2 does not cancel for narrow cones.
    leaving = nodes.add("ShaderNodeNewGeometry").outputs["Incoming"]
    off_axis = nodes.vector("SUBTRACT", leaving, tuple(spotlight.axis))
    squared = nodes.vector("DOT_PRODUCT", off_axis, off_axis)
    shine = nodes.math(squared, -2 / one_minus_cos(spotlight.fov), 4.0, clamp=True)
    if point:
        shine = nodes.math(nodes.math(squared, -0.5, 1.0), shine, 0.0)
    emission = nodes.add("ShaderNodeEmission", Strength=shine)
    emission.inputs["Color"].default_value = (*spotlight.emission, 1)
    nodes.join(emission.outputs["Emission"], nodes.add("ShaderNodeOutputLight").inputs["Surface"])
    body = bpy.data.objects.new("spotlight", light)
    right, up = build_basis(spotlight.axis)
    body.matrix_world = _matrix(-right, up, -spotlight.axis, spotlight.position)
    body.visible_camera = False
    return body


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
    body.matrix_world = _matrix(right, up, -forward, camera.position)
    return body


def _matrix(x: Array, y: Array, z: Array, position: Vec3) -> list[list[float]]:
    """Return the matrix to world space from axes and origin. Blender reads a list as columns."""
    return [[*map(float, column), last] for column, last in ((x, 0.0), (y, 0.0), (z, 0.0), (position, 1.0))]


class _Nodes:
    """A node tree built bottom up. Inputs are constants or sockets of other nodes."""

    def __init__(self, tree: Any) -> None:
        self._tree = tree
        tree.nodes.clear()

    def add(self, kind: str, **inputs: Any) -> Any:
        """Add a node with inputs by name."""
        node = self._tree.nodes.new(kind)
        for name, source in inputs.items():
            self.join(source, node.inputs[name])
        return node

    def join(self, source: Any, socket: Any) -> None:
        """Set an input to a constant, or link it."""
        if isinstance(source, float | tuple):
            socket.default_value = source
        else:
            self._tree.links.new(source, socket)

    def value(self, color: Vec3) -> Any:
        """Return a constant colour as a socket."""
        node = self.add("ShaderNodeCombineXYZ", X=color[0], Y=color[1], Z=color[2])
        return node.outputs[0]

    def vector(self, operation: str, a: Any, b: Any) -> Any:
        """Apply a vector operation to `a` and `b`."""
        node = self._tree.nodes.new("ShaderNodeVectorMath")
        node.operation = operation
        self.join(a, node.inputs[0])
        self.join(b, node.inputs[1])
        return node.outputs["Value" if operation == "DOT_PRODUCT" else "Vector"]

    def math(self, a: Any, factor: Any, summand: float, *, clamp: bool = False) -> Any:
        """Compute a * factor + summand, clamped to [0, 1] on request."""
        node = self._tree.nodes.new("ShaderNodeMath")
        node.operation, node.use_clamp = "MULTIPLY_ADD", clamp
        for source, socket in zip((a, factor, summand), node.inputs, strict=True):
            self.join(source, socket)
        return node.outputs["Value"]
