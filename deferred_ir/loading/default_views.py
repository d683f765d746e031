"""Chooses a camera for a scene without one, and a spotlight for a scene without any light.

Inside and looking across where rays from the middle meet surfaces nearly all around, else from outside. The light's E
makes the mean direct irradiance of what the camera sees 1. Everything is deterministic; +y is up.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from deferred_ir.base.arrays import Array, Vec3
from deferred_ir.base.errors import DeviceError
from deferred_ir.scene.camera import Camera
from deferred_ir.scene.lights.spotlight import Spotlight
from deferred_ir.scene.recentre import recentre
from deferred_ir.scene.scene import Scene

if TYPE_CHECKING:
    from deferred_ir.rays.tracer import Tracer

UP = np.array([0.0, 1.0, 0.0])
ENCLOSED = 0.75
"""A point is inside if at least this fraction of rays from it hit a surface: a box with an open side (5/6) counts."""
ROOMY = 0.03
"""A point with a surface nearer than this fraction of the scene's diagonal is in a gap, not in a room."""
SOLID = 0.75
"""A point is within a solid if this fraction of the surfaces around it face away."""
INSIDE_FOV, OUTSIDE_FOV, ROOM_LIGHT_FOV = 75.0, 45.0, 120.0
VIEW_FROM = np.array([0.55, 0.45, 1.0])
"""Direction from the middle to a camera outside: a three-quarter view."""
MARGIN = 1.1


def choose_views(scene: Scene, camera: bool, spotlight: bool) -> Scene:
    """Return `scene` with its camera, its spotlight or both replaced by chosen ones; fills Scene.chosen."""
    if not (camera or spotlight):
        return scene
    near, reasons = _choose_by_rays(recentre(scene.at(0)), camera, spotlight)
    by = scene.geometry.centre
    views: dict[str, Any] = {"camera": near.camera, "spotlight": near.lights[0] if spotlight else None}
    views = {name: views[name].translate(by) if any(by) else views[name] for name in reasons}
    lights = (views["spotlight"],) if spotlight else scene.lights
    chosen = {name: _describe(views[name], why) for name, why in reasons.items()}
    return replace(scene, camera=views.get("camera", scene.camera), lights=lights, chosen=chosen)


def _choose_by_rays(scene: Scene, camera: bool, spotlight: bool) -> tuple[Scene, dict[str, str]]:
    """Return the scene, which must lie near the origin, with what was chosen, and why, by name."""
    from deferred_ir.rays.tracer import Tracer

    try:
        tracer = Tracer(scene)
    except DeviceError:
        return _choose_by_bounds(scene, camera, spotlight)
    reasons: dict[str, str] = {}
    middle = _find_room_middle(tracer) if camera else _find_seen_middle(tracer, scene.camera)
    if camera:
        view = _make_outside_camera(scene) if middle is None else _choose_inside_camera(tracer, middle)
        reasons["camera"] = "from outside, framing the whole" if middle is None else "inside, looking across"
        scene = replace(scene, camera=view)
    if spotlight:
        lights = [_make_outside_light(scene)] if middle is None else _make_room_lights(tracer, scene.camera, middle)
        light, reasons["spotlight"] = _choose_light(tracer, scene.camera, lights)
        scene = replace(scene, lights=(light,))
    return scene, reasons


def _choose_by_bounds(scene: Scene, camera: bool, spotlight: bool) -> tuple[Scene, dict[str, str]]:
    """Choose views from the bounds alone, where no rays can be traced."""
    reasons = {}
    if camera:
        reasons["camera"] = "from outside, framing the whole: without embreex no rays tell what is inside"
        scene = replace(scene, camera=_make_outside_camera(scene))
    if spotlight:
        reasons["spotlight"] = "irradiance of 1 at the middle: without embreex no rays tell what is lit"
        scene = replace(scene, lights=(_set_emission(_make_outside_light(scene), _square_light_distance(scene)),))
    return scene, reasons


def _describe(item: Camera | Spotlight, why: str) -> dict[str, Any]:
    """Return a camera or a spotlight as values that JSON can hold."""
    keys = ("position", "look_at", "up", "fov", "emission", "radius")
    values = {key: getattr(item, key) for key in keys if hasattr(item, key)}
    return {key: list(value) if isinstance(value, tuple) else value for key, value in values.items()} | {"why": why}


def _to_vec3(values: Array) -> Vec3:
    x, y, z = (float(value) for value in values)
    return x, y, z


def _normalise(vector: Array) -> Array:
    unit: Array = vector / np.linalg.norm(vector)
    return unit


def _spread_over_sphere(count: int) -> Array:
    """Return directions spread evenly over the sphere (a Fibonacci lattice), float64 (count, 3)."""
    index = np.arange(count) + 0.5
    y = 1 - 2 * index / count
    angle, ring = np.pi * (1 + 5**0.5) * index, np.sqrt(1 - y * y)
    return np.stack([ring * np.cos(angle), y, ring * np.sin(angle)], axis=-1)


def _measure_distances(tracer: Tracer, origins: Array, directions: Array) -> tuple[Array, Array]:
    """Return how far rays (n, 3), (n, 3) go, infinite for a miss, and the cosines of the faces that they hit."""
    hits = tracer.closest(origins, directions)
    way = np.where(hits.hit, np.linalg.norm(hits.position - origins, axis=1), np.inf)
    facing = -(tracer.scene.geometry.face_normals[hits.face] * directions).sum(axis=1)
    return way, np.where(hits.hit, facing, 0.0)


def _measure_clearances(tracer: Tracer, points: Array) -> Array:
    """Return the distances of the nearer surfaces around `points` (n, 3); negative for points outside rooms."""
    directions = _spread_over_sphere(128)
    origins = np.repeat(points, len(directions), axis=0)
    way, facing = _measure_distances(tracer, origins, np.tile(directions, (len(points), 1)))
    way, facing = way.reshape(len(points), -1), facing.reshape(len(points), -1)
    hit = np.isfinite(way)
    enclosed = hit.mean(axis=1) >= ENCLOSED
    solid = (facing < 0).sum(axis=1) >= SOLID * np.maximum(hit.sum(axis=1), 1)
    nearer = np.sort(way, axis=1)[:, len(directions) // 10]
    roomy = nearer >= ROOMY * tracer.scene.geometry.diagonal
    clearances: Array = np.where(enclosed & ~solid & roomy, nearer, -1.0)
    return clearances


def _find_room_middle(tracer: Tracer) -> Array | None:
    """Find the point in the middle of the largest room, or None if there is no room.

    The middle of the bounding box may lie in a table or a column, so points around it are tried, too.
    """
    low, high = tracer.scene.geometry.bounds
    steps = np.array([0.5, 0.35, 0.65, 0.2, 0.8])
    grid = np.stack(np.meshgrid(steps, steps, steps, indexing="ij"), axis=-1).reshape(-1, 3)
    points = low + grid * (high - low)
    clearances = _measure_clearances(tracer, points)
    best = int(np.argmax(clearances))
    return points[best] if clearances[best] > 0 else None


def _find_seen_middle(tracer: Tracer, camera: Camera) -> Array | None:
    """Return the point half way to what a camera looks at, or None if that is not inside a room."""
    position, forward = np.array(camera.position), camera.axes[2]
    way, _ = _measure_distances(tracer, position[None], forward[None])
    if not np.isfinite(way[0]):
        return None
    middle = position + forward * way[0] / 2
    return middle if _measure_clearances(tracer, middle[None])[0] > 0 else None


def _measure_free_way(tracer: Tracer, point: Array, directions: Array) -> Array:
    """Return how far it is from `point` along `directions` (n, 3) to a surface or out of the bounds, (n,)."""
    low, high = tracer.scene.geometry.bounds
    with np.errstate(divide="ignore", invalid="ignore"):
        exits = np.where(directions > 0, (high - point) / directions, (low - point) / directions)
    exits = np.where(directions == 0, np.inf, exits).min(axis=1)
    way, _ = _measure_distances(tracer, np.tile(point, (len(directions), 1)), directions)
    free: Array = np.minimum(way, exits)
    return free


def _choose_inside_camera(tracer: Tracer, middle: Array) -> Camera:
    """Choose a camera near a wall that looks through the middle in the level direction that shows most of the room."""
    angles = np.arange(24) * (2 * np.pi / 24)
    forwards = np.stack([np.sin(angles), np.zeros(24), -np.cos(angles)], axis=-1)
    positions = middle - forwards * 0.9 * _measure_free_way(tracer, middle, -forwards)[:, None]
    cameras = [
        Camera(_to_vec3(position), _to_vec3(position + forward * tracer.scene.geometry.diagonal / 4), fov=INSIDE_FOV)
        for position, forward in zip(positions, forwards, strict=True)
    ]
    rays = [camera.rays((12, 12)).reshape(-1, 3) for camera in cameras]
    origins = np.repeat(positions, 144, axis=0)
    hits = tracer.closest(origins, np.concatenate(rays))
    depths = np.where(hits.hit, np.linalg.norm(hits.position - origins, axis=1), 0.0)
    # The median over the view is large only where most rays meet something, and nothing near stands in the way.
    return cameras[int(np.argmax(np.median(depths.reshape(24, -1), axis=1)))]


def _make_outside_camera(scene: Scene) -> Camera:
    """Make a three-quarter view from above that shows all corners of the bounds, with a margin."""
    low, high = scene.geometry.bounds
    centre = (low + high) / 2
    towards = _normalise(VIEW_FROM)
    right = _normalise(np.cross(UP, towards))
    corners = np.stack(np.meshgrid(*np.stack([low, high], axis=1)), axis=-1).reshape(-1, 3) - centre
    aside = np.maximum(np.abs(corners @ right), np.abs(corners @ np.cross(towards, right)))
    distance = (corners @ towards + MARGIN * aside / np.tan(np.radians(OUTSIDE_FOV) / 2)).max()
    return Camera(_to_vec3(centre + towards * distance), _to_vec3(centre), fov=OUTSIDE_FOV)


def _make_room_lights(tracer: Tracer, camera: Camera, middle: Array) -> list[Spotlight]:
    """Make lights at several places in the air that look down and a little along the camera's view."""
    position, forward = np.array(camera.position), camera.axes[2]
    way = _measure_free_way(tracer, position, forward[None])[0]
    grounds = [middle, *(position + forward * way * part for part in (0.25, 0.5, 0.75))]
    aim = _normalise(0.3 * forward - UP) if abs(forward[1]) < 0.99 else -UP
    lights = []
    for ground in grounds:
        height = _measure_free_way(tracer, ground, UP[None])[0]
        for part in (0.9, 0.6, 0.3):
            place = ground + UP * part * max(height, 0.0)
            lights.append(
                Spotlight(
                    _to_vec3(place), _to_vec3(place + aim * tracer.scene.geometry.diagonal / 4), fov=ROOM_LIGHT_FOV
                )
            )
    return lights


def _make_outside_light(scene: Scene) -> Spotlight:
    """Make a light above the camera's side, aimed at the middle, with a cone that covers the bounds."""
    centre, radius = scene.geometry.bounds.mean(axis=0), scene.geometry.diagonal / 2
    side = np.subtract(scene.camera.position, centre) * (1, 0, 1)
    length = np.linalg.norm(side)
    side = side / length if length > 1e-6 * radius else np.array([0.0, 0.0, 1.0])
    left = np.cross(UP, side)
    direction = _normalise(side - 0.5 * left + 1.2 * UP)
    # 3 radii away the bounding sphere fills 39 degrees; at 4/3 of that the soft edge begins outside it.
    fov = 2 * np.degrees(np.arcsin(1 / 3)) * 4 / 3
    return Spotlight(_to_vec3(centre + direction * 3 * radius), _to_vec3(centre), fov=float(fov))


def _set_emission(light: Spotlight, emission: float) -> Spotlight:
    return replace(light, emission=(emission, emission, emission))


def _square_light_distance(scene: Scene) -> float:
    return float((3 * scene.geometry.diagonal / 2) ** 2)


def _choose_light(tracer: Tracer, camera: Camera, lights: list[Spotlight]) -> tuple[Spotlight, str]:
    """Return the one of `lights` that lights what the camera sees most evenly, and why it was chosen.

    Its E gives a mean irradiance of 1. If no light reaches anything visible, one at the camera is chosen.
    """
    lit = _find_best_light(tracer, camera, lights)
    if lit is not None:
        return lit, "mean direct irradiance of what the camera sees is 1"
    lit = _find_best_light(
        tracer, camera, [Spotlight(camera.position, camera.look_at, fov=min(1.5 * camera.fov, 170.0))]
    )
    if lit is not None:
        return lit, "at the camera, as lights elsewhere reach nothing that it sees; mean irradiance of that is 1"
    return _set_emission(
        lights[0], _square_light_distance(tracer.scene)
    ), "the camera sees nothing; E fits the scene's size"


def _find_best_light(tracer: Tracer, camera: Camera, lights: list[Spotlight]) -> Spotlight | None:
    best, best_spread = None, 0.0
    directions = camera.rays((64, 64)).reshape(-1, 3)
    hits = tracer.closest(np.tile(np.array(camera.position), (len(directions), 1)), directions)
    if not hits.hit.any():
        return None
    points = tracer.lift(hits.position[hits.hit], hits.normal[hits.hit])
    for light in lights:
        irradiance = _compute_irradiance(tracer, points, hits.shading_normal[hits.hit], light)
        mean, square = float(irradiance.mean()), float((irradiance**2).mean())
        # 1 for even light, 0 for all of it in one spot.
        spread = mean**2 / square if square > 0 else 0.0
        if spread > best_spread:
            best, best_spread = _set_emission(light, 1 / mean), spread
    return best


def _compute_irradiance(tracer: Tracer, points: Array, normals: Array, light: Spotlight) -> Array:
    """Return the direct irradiance (n,) at `points` (n, 3) under `light` with E = 1, with shadows."""
    origin = np.array(light.position)
    way = points - origin
    distance = np.maximum(np.linalg.norm(way, axis=1), tracer.offset)
    towards = way / distance[:, None]
    intensity = np.maximum(towards @ light.axis, 0) * light.cone(towards)
    cosine = np.maximum(-(normals * towards).sum(axis=1), 0)
    visible = ~tracer.occluded(points, np.tile(origin, (len(points), 1)))
    irradiance: Array = intensity * cosine * visible / distance**2
    return irradiance
