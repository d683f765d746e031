"""Changes of a scene's lights, of all kinds, for the extreme cases. Each takes a scene and returns another."""

from __future__ import annotations

import numpy as np

from deferred_ir.base.arrays import Array, Vec3
from deferred_ir.profiling.checks.changes.triangles import add_triangles, make_box
from deferred_ir.profiling.checks.changes.views import brighten, find_wall, perpendicular, shine_alone, vec3
from deferred_ir.scene.lights.directional import Directional
from deferred_ir.scene.lights.disc import Disc
from deferred_ir.scene.lights.environment import Environment
from deferred_ir.scene.lights.point import Point
from deferred_ir.scene.lights.rect import Rect
from deferred_ir.scene.lights.sphere import Sphere
from deferred_ir.scene.lights.spot import Spot
from deferred_ir.scene.scene import Scene

WHITE: Vec3 = (1.0, 1.0, 1.0)
SKY = 1e-5
"""Radiance of a sky whose sun brings an irradiance of 1."""


def _look(scene: Scene) -> tuple[Array, Array, Array]:
    """Return the camera's place, the surface that it looks at, and the normal there."""
    at, normal = find_wall(scene, scene.camera.position, scene.camera.axes[2])
    return np.asarray(scene.camera.position), at, normal


def _find_sun(scene: Scene) -> Array:
    """Return a direction to the sun: behind the camera and above it."""
    right, up, forward = scene.camera.axes
    towards: Array = 0.2 * right + 0.4 * up - forward
    return towards / np.linalg.norm(towards)


def put_sun_and_sky(scene: Scene) -> Scene:
    """Light the scene by a sun 10^5 times as bright as its sky."""
    sun = Directional(vec3(_find_sun(scene)), (0.0, 0.0, 0.0), WHITE)
    return shine_alone(scene, Environment(radiance=(SKY, SKY, SKY)), sun)


def put_texel(scene: Scene) -> Scene:
    """Light the scene by an environment of which one texel shines."""
    image = np.zeros((64, 128, 3), np.float32)
    x, y, z = _find_sun(scene)
    column, row = (np.arctan2(x, -z) / (2 * np.pi) + 0.5) * 128, np.arccos(y) / np.pi * 64
    image[int(row), int(column) % 128] = 1e4
    return shine_alone(scene, Environment(image=image))


def put_in_wall(scene: Scene, area: bool) -> Scene:
    """Put a thick wall before the surface that the camera looks at, and a point, or a sphere, inside."""
    camera, at, _ = _look(scene)
    middle, half = vec3(0.3 * camera + 0.7 * at), 0.005 * scene.geometry.diagonal
    light = Sphere(middle, half / 2, WHITE) if area else Point(middle, WHITE)
    return add_triangles(shine_alone(scene, light), *make_box(middle, half))


def put_on_wall(scene: Scene, area: bool) -> Scene:
    """Put a point, or a disc that shines away, on the surface that the camera looks at."""
    _, at, normal = _look(scene)
    diagonal = scene.geometry.diagonal
    if area:
        return shine_alone(scene, Disc(vec3(at), vec3(at + diagonal * normal), 0.02 * diagonal, WHITE))
    return shine_alone(scene, Point(vec3(at), WHITE))


def put_edge_on(scene: Scene) -> Scene:
    """Put a rectangle before the surface that the camera looks at, which sees nothing but its edge."""
    camera, at, normal = _look(scene)
    aside, edge = np.array(perpendicular(normal)), 0.1 * scene.geometry.diagonal
    middle = 0.3 * camera + 0.7 * at
    return shine_alone(scene, Rect(vec3(middle), vec3(middle + edge * aside), (edge, edge), vec3(normal), WHITE))


def put_disc(scene: Scene, width: float) -> Scene:
    """Put a disc where the camera is, with its direction. width: in diagonals."""
    camera, at, _ = _look(scene)
    return shine_alone(scene, Disc(vec3(camera), vec3(at), width / 2 * scene.geometry.diagonal, WHITE))


def put_points(scene: Scene, dark: int) -> Scene:
    """Put a point where the camera is, and `dark` ones all over the scene that are off."""
    low, high = scene.geometry.bounds
    places = np.random.default_rng(5).uniform(low, high, (dark, 3))
    off = (Point(vec3(place), (0.0, 0.0, 0.0)) for place in places)
    return shine_alone(scene, *off, Point(scene.camera.position, WHITE))


def mix(scene: Scene, factor: float = 1.0) -> Scene:
    """Light the scene by a light of each kind but the spotlight, about where the camera is. factor: on all light."""
    camera, at, _ = _look(scene)
    right, up, _ = 0.05 * np.linalg.norm(at - camera) * scene.camera.axes
    edge = float(np.linalg.norm(right))
    lights = (
        Point(vec3(camera + right), WHITE),
        Spot(vec3(camera - right), vec3(at), 60.0, 30.0, WHITE),
        Directional(vec3(_find_sun(scene)), (0.0, 0.0, 0.0), WHITE),
        Rect(vec3(camera + up), vec3(at + up), (edge, edge), vec3(up), WHITE),
        Disc(vec3(camera + up + right), vec3(at), edge, WHITE),
        Sphere(vec3(camera - up), edge / 2, WHITE),
        Environment(radiance=WHITE),
    )
    return brighten(shine_alone(scene, *lights), factor)
