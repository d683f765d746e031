"""What the cases of stability_cases.py do to a scene's units, camera and light."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from deferred_ir.base.arrays import Array, Vec3
from deferred_ir.rays.tracer import Tracer
from deferred_ir.scene.camera import Camera
from deferred_ir.scene.recentre import recentre, translate_view
from deferred_ir.scene.scene import Scene


def same(scene: Scene) -> Scene:
    """No change."""
    return scene


def still(scene: Scene) -> Scene:
    """As it is at 0 s, without motions: they know nothing of other units and triangles. Itself where nothing moves."""
    if not scene.moves:
        return scene
    held = scene.at(0.0)
    geometry = replace(
        scene.geometry, positions=held.geometry.positions, normals=held.geometry.normals, moving=(), medians=None
    )
    return replace(held, geometry=geometry, models=tuple(replace(model, motion=None) for model in scene.models))


def vec3(values: Any) -> Vec3:
    """Three floats."""
    x, y, z = (float(value) for value in values)
    return x, y, z


def scaled(scene: Scene, factor: float) -> Scene:
    """In other units, with E so that the picture stays."""
    camera, light = scene.camera, scene.spotlight

    def point(place: Vec3) -> Vec3:
        return vec3(np.multiply(place, factor))

    return replace(
        scene,
        geometry=replace(scene.geometry, positions=scene.geometry.positions * factor),
        camera=replace(camera, position=point(camera.position), look_at=point(camera.look_at)),
        spotlight=replace(
            light,
            position=point(light.position),
            look_at=point(light.look_at),
            radius=light.radius * factor,
            emission=vec3(np.multiply(light.emission, factor**2)),
        ),
    )


def shifted(scene: Scene, by: Vec3) -> Scene:
    """Elsewhere, all of it."""
    geometry = replace(scene.geometry, positions=scene.geometry.positions + by)
    return replace(
        scene, geometry=geometry, camera=translate_view(scene.camera, by), spotlight=translate_view(scene.spotlight, by)
    )


def brighter(scene: Scene, factor: float) -> Scene:
    """With E times `factor`."""
    return with_light(scene, emission=vec3(np.multiply(scene.spotlight.emission, factor)))


def with_light(scene: Scene, **keys: Any) -> Scene:
    """With other values of the spotlight."""
    return replace(scene, spotlight=replace(scene.spotlight, **keys))


def looking_along_up(scene: Scene, angle: float) -> Scene:
    """The camera's up vector at `angle` (radians) to its view, and so that it stands as before."""
    _, up, forward = scene.camera.axes
    tilted = np.cos(angle) * forward + np.sin(angle) * up
    return replace(scene, camera=replace(scene.camera, up=vec3(tilted)))


def wall(scene: Scene, place: Vec3, towards: Array) -> tuple[Array, Array]:
    """Where a ray first lands, and the normal there, towards it; the place itself where it lands nowhere."""
    hits = Tracer(recentre(scene)).closest(np.subtract(place, scene.geometry.centre)[None], towards[None])
    if not hits.hit[0]:
        return np.asarray(place), -towards
    return hits.position[0] + scene.geometry.centre, hits.normal[0]


def across(normal: Array) -> Vec3:
    """A unit vector at right angles to another."""
    other = np.array([0.0, 1.0, 0.0]) if abs(normal[1]) < 0.9 else np.array([1.0, 0.0, 0.0])
    crossed = np.cross(normal, other)
    return vec3(crossed / np.linalg.norm(crossed))


def camera_at_a_wall(scene: Scene, fraction: float, along: bool = False) -> Scene:
    """The camera in front of what it looks at, so many diagonals off, and turned round, or looking along it."""
    at, normal = wall(scene, scene.camera.position, scene.camera.axes[2])
    place, right = at + normal * fraction * scene.geometry.diagonal, np.array(across(normal))
    aim, up = (right, vec3(normal)) if along else (normal, vec3(right))
    return replace(scene, camera=Camera(vec3(place), vec3(place + aim * scene.geometry.diagonal), up, 75.0))


def light_at_a_wall(scene: Scene, fraction: float, grazing: bool = False) -> Scene:
    """The light at what it lit, so many diagonals off, shining back, or along the wall."""
    light = scene.spotlight
    at, normal = wall(scene, light.position, light.axis)
    place = at + normal * fraction * scene.geometry.diagonal
    aim = np.array(across(normal)) + 0.01 * normal if grazing else normal
    return with_light(scene, position=vec3(place), look_at=vec3(place + aim * scene.geometry.diagonal))


def light_in_a_corner(scene: Scene) -> Scene:
    """The light a thousandth of the way from a corner to the middle of what lies about the camera, shining there."""
    camera = scene.camera
    directions = np.array([camera.axes.T @ np.array(way) for way in ((1.0, 1.0, 1.0), (-1.0, 1.0, 1.0))])
    middle = np.asarray(camera.position)
    corner = middle
    for direction in directions:
        at, normal = wall(scene, vec3(corner), direction / np.linalg.norm(direction))
        corner = at + normal * 1e-3 * scene.geometry.diagonal
    # From there along the wall to the next, so that two are a thousandth of the diagonal away.
    at, normal = wall(scene, vec3(corner), np.asarray(across(normal)))
    corner = at + normal * 1e-3 * scene.geometry.diagonal
    return with_light(scene, position=vec3(corner), look_at=vec3(middle))


def facing_each_other(scene: Scene) -> Scene:
    """The camera where the light is, a hair beside it, and looking as it does: what is seen is what is lit."""
    light, diagonal = scene.spotlight, scene.geometry.diagonal
    place = np.asarray(light.position) + 1e-7 * diagonal * np.asarray(across(light.axis))
    camera = Camera(vec3(place), vec3(place + light.axis * diagonal), across(light.axis), min(light.fov, 120.0))
    return replace(scene, camera=camera)
