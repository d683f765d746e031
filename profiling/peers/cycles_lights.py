"""Conversion of lights of every kind to Blender's.

Nodes give cones their shape. Powers in watts are those at which a light has our unit for each unit of its emission.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np

from deferred_ir.base.arrays import Array
from deferred_ir.base.errors import SettingError
from deferred_ir.profiling.peers.cycles_nodes import Nodes, make_matrix
from deferred_ir.sampling.warps import build_basis
from deferred_ir.scene.lights.directional import Directional
from deferred_ir.scene.lights.disc import Disc
from deferred_ir.scene.lights.environment import Environment
from deferred_ir.scene.lights.point import Point
from deferred_ir.scene.lights.rect import Rect
from deferred_ir.scene.lights.sphere import Sphere
from deferred_ir.scene.lights.spot import NARROWEST, Spot
from deferred_ir.scene.lights.spotlight import Spotlight, one_minus_cos
from deferred_ir.scene.scene import Scene

POINT_POWER = 4 * np.pi
"""Power of a point of 1 W/sr, and of a ball: its radiance is that over 4 pi^2 r^2."""
FLAT_POWER = np.pi
"""Power of a flat light that has 1 W/sr along its axis: its radiance is that over pi times its area."""


def convert_lights(bpy: Any, scene: Scene) -> Iterator[Any]:
    """Yield an object for each light that is on; the environment becomes Blender's world. Raises SettingError."""
    shining = [light for light in scene.lights if any(light.emission)]
    if sum(isinstance(light, Environment) for light in shining) > 1:
        raise SettingError("cycles: has one world, and this scene has more environments; leave it out by --peers")
    for light in shining:
        if isinstance(light, Environment):
            _fill_world(bpy, light)
        else:
            yield _CONVERSIONS[light.kind](bpy, light)


def _convert_spotlight(bpy: Any, light: Spotlight) -> Any:
    """Build a point light or a disc. The nodes give the cone and a point's cosine; a disc has the cosine by itself."""

    def shine(nodes: Nodes) -> Any:
        squared = _measure_off_axis(nodes, light.axis)
        cone = nodes.math(squared, -2 / one_minus_cos(light.fov), 4.0, clamp=True)
        return cone if light.radius else nodes.math(nodes.math(squared, -0.5, 1.0), cone, 0.0)

    if light.radius == 0:
        body = _make(bpy, "POINT", light, POINT_POWER, shine)
        body.data.shadow_soft_size = 0
        return body
    body = _make(bpy, "AREA", light, FLAT_POWER, shine)
    body.data.shape, body.data.size = "DISK", 2 * light.radius
    return body


def _convert_spot(bpy: Any, light: Spot) -> Any:
    def shine(nodes: Nodes) -> Any:
        outer = one_minus_cos(light.fov)
        soft = max(NARROWEST, outer - one_minus_cos(light.inner_fov))
        falloff = nodes.math(_measure_off_axis(nodes, light.axis), -0.5 / soft, outer / soft, clamp=True)
        return nodes.math(falloff, falloff, 0.0)

    body = _make(bpy, "POINT", light, POINT_POWER, shine)
    body.data.shadow_soft_size = 0
    return body


def _convert_point(bpy: Any, light: Point) -> Any:
    return _make_ball(bpy, light, POINT_POWER)


def _convert_sphere(bpy: Any, light: Sphere) -> Any:
    return _make_ball(bpy, light, 4 * np.pi**2 * light.radius**2)


def _make_ball(bpy: Any, light: Point | Sphere, power: float) -> Any:
    body = _make(bpy, "POINT", light, power)
    body.data.shadow_soft_size, body.data.use_soft_falloff = light.radius, False
    return body


def _convert_directional(bpy: Any, light: Directional) -> Any:
    body = _make(bpy, "SUN", light, 1.0)
    body.data.angle = float(np.radians(light.angle))
    return body


def _convert_rect(bpy: Any, light: Rect) -> Any:
    body = _make(bpy, "AREA", light, FLAT_POWER * light.area)
    body.data.shape, (body.data.size, body.data.size_y) = "RECTANGLE", light.size
    return body


def _convert_disc(bpy: Any, light: Disc) -> Any:
    body = _make(bpy, "AREA", light, FLAT_POWER * light.area)
    body.data.shape, body.data.size = "DISK", 2 * light.radius
    return body


_CONVERSIONS: Mapping[str, Callable[[Any, Any], Any]] = {
    Spotlight.kind: _convert_spotlight,
    Spot.kind: _convert_spot,
    Point.kind: _convert_point,
    Sphere.kind: _convert_sphere,
    Directional.kind: _convert_directional,
    Rect.kind: _convert_rect,
    Disc.kind: _convert_disc,
}


def _make(bpy: Any, kind: str, light: Any, power: float, shine: Callable[[Nodes], Any] | None = None) -> Any:
    """Build an object of Blender's `kind` of light. shine: builds the strength of its emission by nodes, 1 without."""
    data = bpy.data.lights.new(light.kind, kind)
    data.energy = power
    # A ray that meets it by chance would see it; ours pass.
    data.cycles.use_multiple_importance_sampling = False
    data.use_nodes = True
    nodes = Nodes(data.node_tree)
    node = nodes.add("ShaderNodeEmission", Strength=shine(nodes) if shine else 1.0)
    node.inputs["Color"].default_value = (*light.emission, 1)
    nodes.join(node.outputs["Emission"], nodes.add("ShaderNodeOutputLight").inputs["Surface"])
    body = bpy.data.objects.new(light.kind, data)
    axis = getattr(light, "axis", np.array([0.0, 0.0, -1.0]))
    right, above = build_basis(axis)
    if hasattr(light, "up"):
        right = np.cross(light.up, axis)
        right /= np.linalg.norm(right)
        above = np.cross(axis, right)
    body.matrix_world = make_matrix(-right, above, -axis, light.position)
    body.visible_camera = False
    return body


def _measure_off_axis(nodes: Nodes, axis: Array) -> Any:
    """Return |w - axis|^2 of the direction w from the light: twice 1 - cos(theta), without cancellation."""
    leaving = nodes.add("ShaderNodeNewGeometry").outputs["Incoming"]
    off_axis = nodes.vector("SUBTRACT", leaving, tuple(axis))
    return nodes.vector("DOT_PRODUCT", off_axis, off_axis)


def _fill_world(bpy: Any, light: Environment) -> None:
    world = bpy.data.worlds.new("environment")
    bpy.context.scene.world = world
    world.use_nodes = True
    nodes = Nodes(world.node_tree)
    color = nodes.value(light.emission)
    if light.image is not None:
        height, width, _ = light.image.pixels.shape
        image = bpy.data.images.new("environment", width, height, alpha=False, float_buffer=True, is_data=True)
        pixels = np.ones((height, width, 4), np.float32)
        pixels[..., :3] = light.image.pixels[::-1]
        image.pixels.foreach_set(pixels.ravel())
        # Its azimuth is -atan2(y, x) and its height z; ours are atan2(x, -z) plus the rotation, and y.
        way = nodes.add("ShaderNodeTexCoord").outputs["Generated"]
        sine, cosine = np.sin(np.radians(light.rotation)), np.cos(np.radians(light.rotation))
        turned = nodes.add(
            "ShaderNodeCombineXYZ",
            X=nodes.vector("DOT_PRODUCT", way, (-sine, 0.0, -cosine)),
            Y=nodes.vector("DOT_PRODUCT", way, (-cosine, 0.0, sine)),
            Z=nodes.vector("DOT_PRODUCT", way, (0.0, 1.0, 0.0)),
        )
        lookup = nodes.add("ShaderNodeTexEnvironment", Vector=turned.outputs[0])
        lookup.image, lookup.interpolation = image, "Linear"
        color = nodes.vector("MULTIPLY", color, lookup.outputs["Color"])
    background = nodes.add("ShaderNodeBackground", Color=color)
    nodes.join(background.outputs["Background"], nodes.add("ShaderNodeOutputWorld").inputs["Surface"])
