"""What the cases of stability_cases.py do to a scene's triangles. Each takes a scene and gives another."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from deferred_ir.base.arrays import Array, Ints, Vec3
from deferred_ir.profiling.checks.change_views import across, vec3, wall, with_light
from deferred_ir.scene.geometry import Geometry
from deferred_ir.scene.scene import Scene

SQUARE = ((-1, -1), (1, -1), (1, 1), (-1, 1))


def with_geometry(scene: Scene, **keys: Any) -> Scene:
    """With other arrays of the geometry."""
    return replace(scene, geometry=replace(scene.geometry, **keys))


def with_triangles(scene: Scene, positions: Array, faces: Ints) -> Scene:
    """With more triangles, of the first face's material; they come first, as its texture does."""
    g = scene.geometry
    first, extra = g.faces[0, 0], len(positions)

    def longer(values: Array | None, row: Any) -> Array | None:
        return None if values is None else np.concatenate([values, np.tile(row, (extra, 1))]).astype(values.dtype)

    geometry = Geometry(
        positions=np.concatenate([g.positions, positions]),
        faces=np.concatenate([np.asarray(faces) + len(g.positions), g.faces]).astype(np.int32),
        face_materials=np.concatenate([np.full(len(faces), g.face_materials[0]), g.face_materials]).astype(np.int32),
        normals=longer(g.normals, np.zeros(3)),
        uvs=longer(g.uvs, None if g.uvs is None else g.uvs[first]),
        colors=longer(g.colors, np.ones(3)),
    )
    return replace(scene, geometry=geometry)


def with_squares(scene: Scene, *middles: Array, right: Array, up: Array) -> Scene:
    """With squares about `middles`; right and up: half edges."""
    corners = np.array([middle + x * right + y * up for middle in middles for x, y in SQUARE])
    starts = 4 * np.arange(len(middles))[:, None, None]
    return with_triangles(scene, corners, (starts + np.array([[0, 1, 2], [0, 2, 3]])).reshape(-1, 3))


def box(centre: Vec3, half: float) -> tuple[Array, Ints]:
    """Vertices and faces of an axis-aligned cube, its faces outwards."""
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float) * half + centre
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return corners, np.array([part for a, b, c, d in quads for part in ((a, b, c), (a, c, d))], np.int32)


def light_in_a_box(scene: Scene, half: float) -> Scene:
    """The light within a closed box, of half an edge of so many diagonals, about it."""
    return with_triangles(scene, *box(scene.spotlight.position, half * scene.geometry.diagonal))


def all_in_a_box(scene: Scene, half: float) -> Scene:
    """The same about the camera, and the light a little above it, shining where it looks."""
    camera = scene.camera
    above = vec3(np.add(camera.position, 0.3 * half * scene.geometry.diagonal * camera.axes[1]))
    boxed = with_triangles(scene, *box(camera.position, half * scene.geometry.diagonal))
    return with_light(boxed, position=above, look_at=vec3(np.add(above, camera.axes[2])))


def degenerate(scene: Scene) -> Scene:
    """With triangles that are points and lines."""
    a, b, _ = scene.geometry.positions[scene.geometry.faces[0]]
    return with_triangles(scene, np.array([a, b, (a + b) / 2]), np.array([[0, 0, 0], [0, 1, 1], [0, 1, 2]]))


def doubled(scene: Scene, turned: bool = False) -> Scene:
    """Each face twice, the second perhaps with its back to the front."""
    g = scene.geometry
    order = np.repeat(np.arange(len(g.faces)), 2)
    faces = g.faces[order].copy()
    if turned:
        faces[1::2] = faces[1::2, ::-1]
    return with_geometry(scene, faces=faces, face_materials=g.face_materials[order])


def split(scene: Scene, share: float, whole: bool = False) -> Scene:
    """Each face cut in two along a line that leaves one side the part `share` of it: slivers for small shares.

    whole: the faces stay there besides, so that coplanar triangles overlap.
    """
    g = scene.geometry
    a, b, c = g.faces.T
    new = len(g.positions) + np.arange(len(g.faces))

    def cut(values: Array) -> Array:
        return np.concatenate([values, values[a] * (1 - share) + values[b] * share]).astype(values.dtype)

    parts = [np.stack([a, new, c], axis=1), np.stack([new, b, c], axis=1), *([g.faces] if whole else [])]
    return with_geometry(
        scene,
        positions=cut(g.positions),
        faces=np.stack(parts, axis=1).reshape(-1, 3).astype(np.int32),
        face_materials=np.repeat(g.face_materials, len(parts)),
        normals=None if g.normals is None else cut(g.normals),
        uvs=None if g.uvs is None else cut(g.uvs),
        colors=None if g.colors is None else cut(g.colors),
    )


def with_backdrop(scene: Scene, times: float) -> Scene:
    """With a square `times` diagonals away and twice as wide, behind all that the camera sees."""
    right, up, forward = scene.camera.axes
    far = times * scene.geometry.diagonal
    return with_squares(scene, np.asarray(scene.camera.position) + far * forward, right=far * right, up=far * up)


def near_and_far(scene: Scene, near: float, ratio: float = 1e7) -> Scene:
    """With a card so near that it hides a ninth of the picture's height, and a backdrop `ratio` times farther."""
    right, up, forward = scene.camera.axes
    place = near * scene.geometry.diagonal
    half = place * np.tan(np.radians(scene.camera.fov) / 2) / 3
    middle = np.asarray(scene.camera.position) + place * forward
    with_card = with_squares(scene, middle, right=half * right, up=half * up)
    return with_backdrop(with_card, near * ratio)


def with_giant(scene: Scene, times: float, tilt: float) -> Scene:
    """With a triangle `times` as large as the scene, which cuts it off just beyond what the camera looks at.

    tilt: of its plane against the camera's, radians.
    """
    right, up, forward = scene.camera.axes
    at, _ = wall(scene, scene.camera.position, forward)
    reach = np.linalg.norm(at - scene.camera.position)
    middle = np.asarray(scene.camera.position) + 0.8 * reach * forward
    along = np.cos(tilt) * up + np.sin(tilt) * forward
    size = times * scene.geometry.diagonal
    corners = [middle + size * (x * right + y * along) for x, y in ((-1.0, -0.7), (1.1, -0.6), (0.1, 0.9))]
    return with_triangles(scene, np.array(corners), np.array([[0, 1, 2]]))


def thin_walls(scene: Scene, apart: float) -> Scene:
    """With two squares across the light's way, `apart` diagonals from each other."""
    light, diagonal = scene.spotlight, scene.geometry.diagonal
    at, _ = wall(scene, light.position, light.axis)
    middle, right = (np.asarray(light.position) + at) / 2, np.array(across(light.axis))
    half = 0.05 * diagonal
    behind = middle + apart * diagonal * light.axis
    return with_squares(scene, middle, behind, right=half * right, up=half * np.cross(light.axis, right))
