"""Changes of a scene's units, camera and lights for the extreme cases. Each takes a scene and returns another."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, replace
from typing import Any

import numpy as np

from deferred_ir.base.arrays import Array, Vec3
from deferred_ir.rays.tracer import Tracer
from deferred_ir.scene.camera import Camera
from deferred_ir.scene.lights.base import Light
from deferred_ir.scene.lights.environment import Environment
from deferred_ir.scene.lights.fields import COLOURS
from deferred_ir.scene.recentre import recentre
from deferred_ir.scene.scene import Scene


def same(scene: Scene) -> Scene:
    """Return the scene itself."""
    return scene


def freeze(scene: Scene) -> Scene:
    """Freeze the scene at 0 s, since motions would not fit changed units. Returns the scene itself if nothing moves."""
    if not scene.moves:
        return scene
    frozen = scene.at(0.0)
    geometry = replace(
        scene.geometry, positions=frozen.geometry.positions, normals=frozen.geometry.normals, moving=(), medians=None
    )
    return replace(frozen, geometry=geometry, models=tuple(replace(model, motion=None) for model in scene.models))


def vec3(values: Any) -> Vec3:
    """Convert to three floats."""
    x, y, z = (float(value) for value in values)
    return x, y, z


class Unsuited(Exception):  # noqa: N818 - no error: a scene may lack what a case changes
    """A scene lacks what a case changes; says what."""


def scale(scene: Scene, factor: float) -> Scene:
    """Change the units, and intensities with them, so that the image stays the same."""
    camera = scene.camera

    def point(place: Vec3) -> Vec3:
        return vec3(np.multiply(place, factor))

    lengths = {"position": factor, "look_at": factor, "radius": factor, "size": factor}
    powers = {"emission": factor**2, "intensity": factor**2}
    return replace(
        scene,
        geometry=replace(scene.geometry, positions=scene.geometry.positions * factor),
        camera=replace(camera, position=point(camera.position), look_at=point(camera.look_at)),
        lights=tuple(_multiply(light, lengths | powers) for light in scene.lights),
    )


def _multiply(light: Any, factors: Mapping[str, float]) -> Any:
    """Multiply those fields of a light that it has."""
    own = {field.name for field in fields(light)}
    found = {
        name: np.multiply(getattr(light, name), factor).tolist() for name, factor in factors.items() if name in own
    }
    return replace(light, **found)


def shift(scene: Scene, by: Vec3) -> Scene:
    """Translate the whole scene."""
    geometry = replace(scene.geometry, positions=scene.geometry.positions + by)
    lights = tuple(light.translate(by) for light in scene.lights)
    return replace(scene, geometry=geometry, camera=scene.camera.translate(by), lights=lights)


def brighten(scene: Scene, factor: float) -> Scene:
    """Multiply all light by `factor`."""
    lights = tuple(_brighten_light(light, factor) for light in scene.lights)
    return replace(_light_surfaces(scene, factor), lights=lights)


def _brighten_light(light: Any, factor: float) -> Any:
    if isinstance(light, Environment):
        return replace(light, scale=light.scale * factor)
    return _multiply(light, dict.fromkeys(COLOURS, factor))


def _light_surfaces(scene: Scene, factor: float) -> Scene:
    """Multiply what surfaces emit by `factor`."""
    if scene.surface_light is None:
        return scene
    materials = tuple(replace(each, emission=vec3(np.multiply(each.emission, factor))) for each in scene.materials)
    return replace(scene, materials=materials)


def shine_alone(scene: Scene, *lights: Light) -> Scene:
    """Replace all that shines by `lights`."""
    return replace(_light_surfaces(scene, 0.0), lights=lights)


def find_light(scene: Scene) -> Any:
    """Return the first light whose maps look from a place. Raises Unsuited if there is none."""
    for light in scene.direct_lights:
        if any(view.fov for view in light.list_views(scene.bounds)):
            return light
    raise Unsuited("no light shines from a point")


def find_aim(scene: Scene, light: Any) -> Array:
    """Return the unit direction in which a light looks; that of the camera if it shines all around."""
    axis: Array = light.axis if hasattr(light, "axis") else scene.camera.axes[2]
    return axis


def with_light(scene: Scene, **keys: Any) -> Scene:
    """Change values of the light that `find_light` finds, and leave no other. Raises Unsuited if it has no cone."""
    light = find_light(scene)
    own = {field.name for field in fields(light)}
    if "fov" in keys and "fov" not in own:
        raise Unsuited("no light has a cone")
    if keys.get("fov", np.inf) < getattr(light, "inner_fov", 0.0):
        keys["inner_fov"] = 0.0
    return shine_alone(scene, replace(light, **{name: value for name, value in keys.items() if name in own}))


def tilt_up(scene: Scene, angle: float) -> Scene:
    """Turn the camera's up vector to `angle` (radians) from its view direction; the image stays the same."""
    _, up, forward = scene.camera.axes
    tilted = np.cos(angle) * forward + np.sin(angle) * up
    return replace(scene, camera=replace(scene.camera, up=vec3(tilted)))


def find_wall(scene: Scene, place: Vec3, towards: Array) -> tuple[Array, Array]:
    """Return a ray's first hit and the normal there, facing the ray; the origin and -towards if it hits nothing."""
    hits = Tracer(recentre(scene)).closest(np.subtract(place, scene.geometry.centre)[None], towards[None])
    if not hits.hit[0]:
        return np.asarray(place), -towards
    return hits.position[0] + scene.geometry.centre, hits.normal[0]


def perpendicular(normal: Array) -> Vec3:
    """Return a unit vector perpendicular to another."""
    other = np.array([0.0, 1.0, 0.0]) if abs(normal[1]) < 0.9 else np.array([1.0, 0.0, 0.0])
    crossed = np.cross(normal, other)
    return vec3(crossed / np.linalg.norm(crossed))


def put_camera_at_wall(scene: Scene, fraction: float, along: bool = False) -> Scene:
    """Put the camera `fraction` diagonals off the surface it looks at, turned round or, with `along`, along it."""
    at, normal = find_wall(scene, scene.camera.position, scene.camera.axes[2])
    place, right = at + normal * fraction * scene.geometry.diagonal, np.array(perpendicular(normal))
    aim, up = (right, vec3(normal)) if along else (normal, vec3(right))
    return replace(scene, camera=Camera(vec3(place), vec3(place + aim * scene.geometry.diagonal), up, 75.0))


def put_light_at_wall(scene: Scene, fraction: float, grazing: bool = False) -> Scene:
    """Put the light `fraction` diagonals off the surface it lit, shining away from it or, with `grazing`, along it."""
    light = find_light(scene)
    at, normal = find_wall(scene, light.position, find_aim(scene, light))
    place = at + normal * fraction * scene.geometry.diagonal
    aim = np.array(perpendicular(normal)) + 0.01 * normal if grazing else normal
    return with_light(scene, position=vec3(place), look_at=vec3(place + aim * scene.geometry.diagonal))


def put_light_in_corner(scene: Scene) -> Scene:
    """Put the light a thousandth of the diagonal off the walls of a corner, shining at the camera's place."""
    camera = scene.camera
    directions = np.array([camera.axes.T @ np.array(way) for way in ((1.0, 1.0, 1.0), (-1.0, 1.0, 1.0))])
    middle = np.asarray(camera.position)
    corner = middle
    for direction in directions:
        at, normal = find_wall(scene, vec3(corner), direction / np.linalg.norm(direction))
        corner = at + normal * 1e-3 * scene.geometry.diagonal
    # From there along the wall to the next wall, so that both are a thousandth of the diagonal away.
    at, normal = find_wall(scene, vec3(corner), np.asarray(perpendicular(normal)))
    corner = at + normal * 1e-3 * scene.geometry.diagonal
    return with_light(scene, position=vec3(corner), look_at=vec3(middle))


def put_camera_at_light(scene: Scene) -> Scene:
    """Put the camera just beside the light with its direction: everything visible is lit."""
    light, diagonal = find_light(scene), scene.geometry.diagonal
    aim, fov = find_aim(scene, light), min(getattr(light, "fov", 120.0), 120.0)
    place = np.asarray(light.position) + 1e-7 * diagonal * np.asarray(perpendicular(aim))
    camera = Camera(vec3(place), vec3(place + aim * diagonal), perpendicular(aim), fov)
    return replace(scene, camera=camera)
