"""Balls on a floor below a sky and a panel, of metal or plastic of one roughness, and a room in which some are metal.

Balls are facets without smooth normals, since renderers differ in what they do where a smooth normal faces away from
the camera. Scenes are made in memory, not read.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from deferred_ir.base.arrays import Array, Vec3
from deferred_ir.profiling import light_scenes
from deferred_ir.profiling.light_scenes import paint_sky
from deferred_ir.scene.camera import Camera
from deferred_ir.scene.geometry import Geometry, Model
from deferred_ir.scene.lights.environment import Environment
from deferred_ir.scene.scene import Scene
from deferred_ir.scene.surfaces.materials import Material

ROUGHNESS = 0.1, 0.2, 0.4, 0.7, 1.0
CAMERA = Camera((0.0, 1.2, 3.2), (0.0, 0.35, 0.0), fov=45.0)
BALLS: tuple[Vec3, ...] = ((-0.95, 0.45, 0.0), (0.05, 0.45, -0.35), (1.0, 0.45, 0.1))
PANEL = Material("panel", (0.0, 0.0, 0.0), emission=(5.0, 4.5, 4.0), emits_both_sides=True)


def build_balls(material: Material) -> Scene:
    """Build the scene out of one material."""
    import trimesh

    ball = trimesh.creation.icosphere(4, radius=0.45)
    panel = np.array([(-1.6, 0.3, -1.4), (0.2, 0.3, -1.9), (0.2, 1.5, -1.9), (-1.6, 1.5, -1.4)])
    floor = np.array([(-2.0, 0, 2.0), (2.0, 0, 2.0), (2.0, 0, -2.0), (-2.0, 0, -2.0)])
    square = np.array([[0, 1, 2], [0, 2, 3]])
    parts: list[tuple[Array, Array, int]] = [(floor, square, 0), (panel, square, 1)]
    parts += [(np.add(ball.vertices, place), np.array(ball.faces), 0) for place in BALLS]
    starts = np.cumsum([0, *(len(corners) for corners, _, _ in parts)])
    geometry = Geometry(
        positions=np.concatenate([corners for corners, _, _ in parts]),
        faces=np.concatenate([faces + start for (_, faces, _), start in zip(parts, starts[:-1], strict=True)]).astype(
            np.int32
        ),
        face_materials=np.repeat([number for _, _, number in parts], [len(faces) for _, faces, _ in parts]).astype(
            np.int32
        ),
    )
    sky = Environment(image=paint_sky(), rotation=25.0)
    models = (Model("balls", 0, int(starts[-1])),)
    return Scene("balls", Path("balls"), geometry, (material, PANEL), (), models, CAMERA, (sky,))


def _build_metal(color: Vec3, roughness: float) -> Scene:
    return build_balls(Material("metal", color, metallic=1.0, roughness=roughness))


def _build_plastic(roughness: float) -> Scene:
    return build_balls(Material("plastic", (0.6, 0.3, 0.2), specular=1.0, roughness=roughness))


def build_mixed_room() -> Scene:
    """Build the room of light_scenes.py, with its sky, its box of brushed metal and its ball of polished metal."""
    room = light_scenes.SCENES["open sky"]()
    *walls, box, ball = room.materials
    box, ball = (replace(one, metallic=1.0, roughness=r) for one, r in ((box, 0.4), (ball, 0.1)))
    return replace(room, name="mixed room", materials=(*walls, box, ball))


SCENES: Mapping[str, Callable[[], Scene]] = {
    **{f"white metal {r}": partial(_build_metal, (1.0, 1.0, 1.0), r) for r in ROUGHNESS},
    **{f"copper {r}": partial(_build_metal, (0.9, 0.5, 0.35), r) for r in (0.2, 0.6)},
    **{f"plastic {r}": partial(_build_plastic, r) for r in (0.2, 0.6)},
    "mixed room": build_mixed_room,
}
"""The scenes by name. Metals are the same in Mitsuba; of plastic, and of metal beside what is matt, it has more."""
