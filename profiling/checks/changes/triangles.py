"""Changes of a scene's triangles for the extreme cases. Each takes a scene and returns another."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from deferred_ir.base.arrays import Array, Ints, Vec3
from deferred_ir.profiling.checks.changes.views import find_aim, find_light, find_wall, perpendicular, vec3, with_light
from deferred_ir.scene.geometry import Geometry
from deferred_ir.scene.scene import Scene

SQUARE = ((-1, -1), (1, -1), (1, 1), (-1, 1))


def with_geometry(scene: Scene, **keys: Any) -> Scene:
    """Replace arrays of the geometry."""
    return replace(scene, geometry=replace(scene.geometry, **keys))


def add_triangles(scene: Scene, positions: Array, faces: Ints) -> Scene:
    """Add triangles with the first face's material. They come first, since faces are sorted by texture."""
    g = scene.geometry
    first, extra = g.faces[0, 0], len(positions)

    def extend(values: Array | None, row: Any) -> Array | None:
        return None if values is None else np.concatenate([values, np.tile(row, (extra, 1))]).astype(values.dtype)

    geometry = Geometry(
        positions=np.concatenate([g.positions, positions]),
        faces=np.concatenate([np.asarray(faces) + len(g.positions), g.faces]).astype(np.int32),
        face_materials=np.concatenate([np.full(len(faces), g.face_materials[0]), g.face_materials]).astype(np.int32),
        normals=extend(g.normals, np.zeros(3)),
        uvs=extend(g.uvs, None if g.uvs is None else g.uvs[first]),
        colors=extend(g.colors, np.ones(3)),
        second_uvs=extend(g.second_uvs, None if g.second_uvs is None else g.second_uvs[first]),
        tangents=extend(g.tangents, np.zeros(4)),
    )
    return replace(scene, geometry=geometry)


def add_squares(scene: Scene, *middles: Array, right: Array, up: Array) -> Scene:
    """Add squares with centres `middles`. right, up: half of their edges, as vectors."""
    corners = np.array([middle + x * right + y * up for middle in middles for x, y in SQUARE])
    starts = 4 * np.arange(len(middles))[:, None, None]
    return add_triangles(scene, corners, (starts + np.array([[0, 1, 2], [0, 2, 3]])).reshape(-1, 3))


def make_box(centre: Vec3, half: float) -> tuple[Array, Ints]:
    """Return vertices and faces of an axis-aligned cube whose faces point outwards."""
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float) * half + centre
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return corners, np.array([part for a, b, c, d in quads for part in ((a, b, c), (a, c, d))], np.int32)


def put_light_in_box(scene: Scene, half: float) -> Scene:
    """Close a box around the light. half: half of its edge, in diagonals."""
    lit = with_light(scene)
    return add_triangles(lit, *make_box(find_light(lit).position, half * scene.geometry.diagonal))


def put_all_in_box(scene: Scene, half: float) -> Scene:
    """Close a box around the camera and put the light a little above it, with its direction. half: as above."""
    camera = scene.camera
    above = vec3(np.add(camera.position, 0.3 * half * scene.geometry.diagonal * camera.axes[1]))
    boxed = add_triangles(scene, *make_box(camera.position, half * scene.geometry.diagonal))
    return with_light(boxed, position=above, look_at=vec3(np.add(above, camera.axes[2])))


def add_degenerate(scene: Scene) -> Scene:
    """Add triangles that are points and lines."""
    a, b, _ = scene.geometry.positions[scene.geometry.faces[0]]
    return add_triangles(scene, np.array([a, b, (a + b) / 2]), np.array([[0, 0, 0], [0, 1, 1], [0, 1, 2]]))


def double_faces(scene: Scene, turned: bool = False) -> Scene:
    """Repeat each face, with `turned` facing the other way."""
    g = scene.geometry
    order = np.repeat(np.arange(len(g.faces)), 2)
    faces = g.faces[order].copy()
    if turned:
        faces[1::2] = faces[1::2, ::-1]
    return with_geometry(scene, faces=faces, face_materials=g.face_materials[order])


def split_faces(scene: Scene, fraction: float, whole: bool = False) -> Scene:
    """Cut each face in two; one side gets `fraction` of the area: a sliver if it is small.

    whole: keep the faces as well, so that coplanar triangles overlap.
    """
    g = scene.geometry
    a, b, c = g.faces.T
    new = len(g.positions) + np.arange(len(g.faces))

    def cut(values: Array) -> Array:
        return np.concatenate([values, values[a] * (1 - fraction) + values[b] * fraction]).astype(values.dtype)

    parts = [np.stack([a, new, c], axis=1), np.stack([new, b, c], axis=1), *([g.faces] if whole else [])]
    return with_geometry(
        scene,
        positions=cut(g.positions),
        faces=np.stack(parts, axis=1).reshape(-1, 3).astype(np.int32),
        face_materials=np.repeat(g.face_materials, len(parts)),
        normals=None if g.normals is None else cut(g.normals),
        uvs=None if g.uvs is None else cut(g.uvs),
        colors=None if g.colors is None else cut(g.colors),
        second_uvs=None if g.second_uvs is None else cut(g.second_uvs),
        tangents=None if g.tangents is None else cut(g.tangents),
    )


def add_backdrop(scene: Scene, times: float) -> Scene:
    """Add a square behind everything that the camera sees, `times` diagonals away and twice as wide."""
    right, up, forward = scene.camera.axes
    far = times * scene.geometry.diagonal
    return add_squares(scene, np.asarray(scene.camera.position) + far * forward, right=far * right, up=far * up)


def add_near_and_far(scene: Scene, near: float, ratio: float = 1e7) -> Scene:
    """Add a card near the camera that hides a third of the image's height, and a backdrop `ratio` times farther."""
    right, up, forward = scene.camera.axes
    place = near * scene.geometry.diagonal
    half = place * np.tan(np.radians(scene.camera.fov) / 2) / 3
    middle = np.asarray(scene.camera.position) + place * forward
    with_card = add_squares(scene, middle, right=half * right, up=half * up)
    return add_backdrop(with_card, near * ratio)


def add_large_triangle(scene: Scene, times: float, tilt: float) -> Scene:
    """Add a triangle `times` as large as the scene, just in front of the surface that the camera looks at.

    tilt: angle between its plane and the image plane, radians.
    """
    right, up, forward = scene.camera.axes
    at, _ = find_wall(scene, scene.camera.position, forward)
    reach = np.linalg.norm(at - scene.camera.position)
    middle = np.asarray(scene.camera.position) + 0.8 * reach * forward
    along = np.cos(tilt) * up + np.sin(tilt) * forward
    size = times * scene.geometry.diagonal
    corners = [middle + size * (x * right + y * along) for x, y in ((-1.0, -0.7), (1.1, -0.6), (0.1, 0.9))]
    return add_triangles(scene, np.array(corners), np.array([[0, 1, 2]]))


def add_thin_walls(scene: Scene, apart: float) -> Scene:
    """Add two squares across the light's path, `apart` diagonals from each other."""
    light, diagonal = find_light(scene), scene.geometry.diagonal
    aim = find_aim(scene, light)
    at, _ = find_wall(scene, light.position, aim)
    middle, right = (np.asarray(light.position) + at) / 2, np.array(perpendicular(aim))
    half = 0.05 * diagonal
    behind = middle + apart * diagonal * aim
    return add_squares(scene, middle, behind, right=half * right, up=half * np.cross(aim, right))
