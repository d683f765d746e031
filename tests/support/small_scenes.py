"""Scenes small enough to know everything about, built in code."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from deferred_ir.scene.camera import Camera
from deferred_ir.scene.lights.spotlight import Spotlight
from deferred_ir.scene.motion import ModelMotion
from deferred_ir.scene.scene import Geometry, Model, Scene
from deferred_ir.scene.surfaces.materials import Material, Texture, TextureRef

GREY = (0.5, 0.5, 0.5)
FAR = (1e5, -2e5, 3e5)
"""Far enough from the origin for 32-bit coordinates to lose small features."""


@dataclass(frozen=True)
class Mesh:
    """positions (V, 3), faces (F, 3), one albedo, unit normals (V, 3) or None."""

    positions: Any
    faces: Any
    albedo: tuple[float, float, float] = GREY
    normals: Any = None


def quad(a: Sequence[float], b: Sequence[float], c: Sequence[float], albedo: tuple[float, float, float] = GREY) -> Mesh:
    """The parallelogram with corners a, b, c and c - b + a, counter-clockwise from its front."""
    corners = np.array([a, b, c, np.add(np.subtract(c, b), a)], dtype=float)
    return Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]]), albedo)


def plane(half: float = 1.0, height: float = 0.0, albedo: tuple[float, float, float] = GREY) -> Mesh:
    """A square of edge 2 * half at y = height that faces +y."""
    return quad((-half, height, half), (half, height, half), (half, height, -half), albedo)


def box(low: Sequence[float], high: Sequence[float], albedo: tuple[float, float, float] = GREY) -> Mesh:
    """An axis-aligned box, its faces outwards."""
    import trimesh

    mesh = trimesh.creation.box(bounds=[low, high])
    return Mesh(np.array(mesh.vertices), np.array(mesh.faces), albedo)


def sphere(radius: float = 1.0, subdivisions: int = 3, albedo: tuple[float, float, float] = GREY) -> Mesh:
    """A tessellated sphere about the origin with smooth normals."""
    import trimesh

    mesh = trimesh.creation.icosphere(subdivisions=subdivisions)
    unit = np.array(mesh.vertices)
    return Mesh(unit * radius, np.array(mesh.faces), albedo, unit)


def build(
    *meshes: Mesh,
    camera: Camera | None = None,
    spotlight: Spotlight | None = None,
    motions: Sequence[ModelMotion | None] | None = None,
) -> Scene:
    """A scene of these meshes, a material for each. One model, or a model of each mesh if they have `motions`."""
    starts = np.cumsum([0, *(len(mesh.positions) for mesh in meshes)])
    smooth = any(mesh.normals is not None for mesh in meshes)
    normals = [np.zeros_like(mesh.positions) if mesh.normals is None else mesh.normals for mesh in meshes]
    models = tuple(
        Model(f"model {i}", int(starts[i]), len(mesh.positions), motion)
        for i, (mesh, motion) in enumerate(zip(meshes, motions or (), strict=bool(motions)))
    )
    geometry = Geometry(
        positions=np.concatenate([mesh.positions for mesh in meshes]).astype(np.float64),
        faces=np.concatenate([mesh.faces + start for mesh, start in zip(meshes, starts, strict=False)]).astype("i4"),
        face_materials=np.repeat(np.arange(len(meshes)), [len(mesh.faces) for mesh in meshes]).astype("i4"),
        normals=np.concatenate(normals).astype("f4") if smooth else None,
        moving=tuple(model for model in models if model.motion),
    )
    return Scene(
        name="built",
        path=Path("built"),
        geometry=geometry,
        materials=tuple(Material(f"material {i}", mesh.albedo) for i, mesh in enumerate(meshes)),
        textures=(),
        models=models or (Model("built", 0, int(starts[-1])),),
        camera=camera or Camera((0.0, 2.0, 3.0), (0.0, 0.0, 0.0)),
        lights=(spotlight or Spotlight((0.3, 1.5, 0.2), (0.0, 0.0, 0.0), 70.0, (3.0, 2.0, 1.0)),),
    )


def room(albedo: tuple[float, float, float] = GREY) -> Scene:
    """A closed room of 2 x 2 x 2 about the origin with a box in it; light and camera inside."""
    return build(
        box((-1, -1, -1), (1, 1, 1), albedo),
        box((-0.2, -1, -0.5), (0.3, -0.3, 0.0), (0.7, 0.2, 0.1)),
        camera=Camera((0.1, 0.2, 0.95), (0.0, -0.2, -0.5), fov=75.0),
        spotlight=Spotlight((-0.4, 0.9, 0.3), (0.1, -1.0, -0.1), 90.0, (3.0, 2.5, 2.0)),
    )


def two_rooms() -> Scene:
    """Two rooms and a door between them: the light is in one, and the camera sees only what comes through to the other.

    The door is a tenth of the wall and reaches to the ceiling.
    """
    return build(
        box((-2, -1, -1), (2, 1, 1), (0.7, 0.7, 0.7)),
        box((-0.05, -1, -1), (0.05, 1, 0.8), (0.6, 0.4, 0.3)),
        camera=Camera((0.4, 0.0, -0.9), (1.9, -0.2, 0.5), fov=70.0),
        spotlight=Spotlight((-0.4, 0.8, -0.5), (-0.4, -1.0, 0.6), 110.0, (3.0, 2.5, 2.0)),
    )


def crooked_room() -> Scene:
    """`room` with its corners out of place: no wall is parallel to another, so depths never tie along a whole wall."""
    scene = room()
    off = np.random.default_rng(8).uniform(-0.12, 0.12, scene.geometry.positions.shape)
    return replace(scene, geometry=replace(scene.geometry, positions=scene.geometry.positions + off))


def smooth_scene() -> Scene:
    """A ball with smooth normals between a floor and a ceiling."""
    ball = sphere(0.5, 2)
    walls = room()
    floor = replace(ball, positions=ball.positions + np.array([0.3, -0.4, 0.3]))
    return build(floor, plane(0.99, -0.99), plane(0.99, 0.95), camera=walls.camera, spotlight=walls.spotlight)


def textured(scene: Scene, pixels: Any, uvs: Any) -> Scene:
    """`scene`, whose last material gets an image texture; uvs: (V, 2) of all vertices."""
    geometry = replace(scene.geometry, uvs=np.asarray(uvs, "f4"))
    last = replace(scene.materials[-1], base_color_texture=TextureRef(0))
    pattern = Texture("pattern", np.asarray(pixels, np.uint8))
    return replace(scene, geometry=geometry, materials=(*scene.materials[:-1], last), textures=(pattern,))


def scaled(scene: Scene, factor: float) -> Scene:
    """`scene` in other units of length, its light's emission so that the image stays the same."""

    def point(p: Sequence[float]) -> tuple[float, float, float]:
        x, y, z = (factor * value for value in p)
        return x, y, z

    light = scene.spotlight
    emission = tuple(factor**2 * value for value in light.emission)
    return replace(
        scene,
        geometry=replace(scene.geometry, positions=scene.geometry.positions * factor),
        camera=replace(scene.camera, position=point(scene.camera.position), look_at=point(scene.camera.look_at)),
        lights=(replace(light, position=point(light.position), look_at=point(light.look_at), emission=emission),),
    )


def move_away(scene: Scene, by: tuple[float, float, float] = FAR) -> Scene:
    """`scene` somewhere else: vertices, camera and light moved by the same vector."""
    geometry = replace(scene.geometry, positions=scene.geometry.positions + by)
    return replace(scene, geometry=geometry, camera=scene.camera.translate(by), lights=(scene.spotlight.translate(by),))


def gable() -> Scene:
    """A roof below the light: the camera sees one slope and the wall it faces; the other slope faces away."""
    return build(
        quad((-1, -1, 1), (0, 0, 1), (0, 0, -1), (0.7, 0.2, 0.1)),
        quad((0.3, -0.3, 1), (2.5, -2.5, 1), (2.5, -2.5, -1)),
        quad((4, -4, 4), (4, 2, 4), (4, 2, -4), (0.2, 0.3, 0.8)),
        camera=Camera((1, 1, 0.2), (2.5, -1.5, 0), fov=60.0),
        spotlight=Spotlight((0.1, 1.6, 0.1), (0.1, -1.0, 0.0), 100.0, (3.0, 2.5, 2.0)),
    )


def triangle_soup(seed: int, count: int = 300, scale: float = 1.0, offset: float = 0.0) -> Mesh:
    """Triangles from a ten-thousandth of the scene to ten times its size, slivers and degenerate ones among them."""
    rng = np.random.default_rng(seed)
    size = 10.0 ** rng.uniform(-4, 1, (count, 1, 1))
    corners = rng.uniform(-1, 1, (count, 1, 3)) + size * rng.normal(size=(count, 3, 3))
    corners[::17, 2] = corners[::17, 1]
    corners[1::17, 2] = corners[1::17, 0] * 0.5 + corners[1::17, 1] * 0.5
    return Mesh(corners.reshape(-1, 3) * scale + offset, np.arange(3 * count).reshape(-1, 3))
