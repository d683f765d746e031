"""One room with a box and a ball, lit by each kind of light, by a mixture, by panels, and by the sky.

What has an area hangs above the room, which then has no ceiling: other renderers take it for geometry, and there it
hides nothing that matters. All materials are matt; lengths are in metres. Scenes are made in memory, not read.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from deferred_ir.base.arrays import Array, Vec3
from deferred_ir.scene.camera import Camera
from deferred_ir.scene.geometry import Geometry, Model
from deferred_ir.scene.lights.base import Light
from deferred_ir.scene.lights.directional import Directional
from deferred_ir.scene.lights.disc import Disc
from deferred_ir.scene.lights.environment import Environment
from deferred_ir.scene.lights.point import Point
from deferred_ir.scene.lights.rect import Rect
from deferred_ir.scene.lights.sphere import Sphere
from deferred_ir.scene.lights.spot import Spot
from deferred_ir.scene.lights.spotlight import Spotlight
from deferred_ir.scene.scene import Scene
from deferred_ir.scene.surfaces.materials import Material, Texture, TextureRef

HALF, HEIGHT = 2.0, 2.5
"""Half the room's width and depth, and its height."""
CAMERA = Camera((0.4, 1.3, 1.9), (-0.1, 0.75, -1.0), fov=62.0)
MATERIALS = (
    Material("floor", (0.6, 0.55, 0.5)),
    Material("walls", (0.7, 0.7, 0.7)),
    Material("red wall", (0.63, 0.1, 0.08)),
    Material("green wall", (0.15, 0.5, 0.12)),
    Material("box", (0.7, 0.6, 0.25)),
    Material("ball", (0.3, 0.4, 0.75)),
)

Part = tuple[Array, Array, int]
"""Corners (v, 3), faces (f, 3) and the number of a material."""


def _quad(a: Vec3, b: Vec3, c: Vec3, material: int) -> Part:
    """Return the parallelogram a, b, c and c - b + a, counter-clockwise from its front."""
    corners = np.array([a, b, c, np.add(np.subtract(c, b), a)], float)
    return corners, np.array([[0, 1, 2], [0, 2, 3]]), material


def _list_parts(*, ceiling: bool) -> list[Part]:
    import trimesh

    x, y, z = HALF, HEIGHT, HALF
    parts = [
        _quad((-x, 0, z), (x, 0, z), (x, 0, -z), 0),
        _quad((-x, 0, -z), (x, 0, -z), (x, y, -z), 1),
        _quad((x, 0, z), (-x, 0, z), (-x, y, z), 1),
        _quad((-x, 0, z), (-x, 0, -z), (-x, y, -z), 2),
        _quad((x, 0, -z), (x, 0, z), (x, y, z), 3),
    ]
    if ceiling:
        parts.append(_quad((-x, y, -z), (x, y, -z), (x, y, z), 1))
    box = trimesh.creation.box((0.7, 1.1, 0.7))
    turn = np.array([[np.cos(0.4), 0, np.sin(0.4)], [0, 1, 0], [-np.sin(0.4), 0, np.cos(0.4)]])
    parts.append((np.add(box.vertices @ turn.T, (-0.7, 0.55, -0.8)), np.array(box.faces), 4))
    ball = trimesh.creation.icosphere(4, radius=0.45)
    parts.append((np.add(ball.vertices, (0.75, 0.45, -0.4)), np.array(ball.faces), 5))
    return parts


def _build(
    name: str,
    lights: tuple[Light, ...],
    *,
    ceiling: bool = False,
    panels: tuple[tuple[Part, Material], ...] = (),
    textures: tuple[Texture, ...] = (),
) -> Scene:
    """Build the room with `lights` and emitting `panels`. An image covers the whole of a panel with a texture."""
    materials = (*MATERIALS, *(material for _, material in panels))
    parts = _list_parts(ceiling=ceiling)
    parts += [(corners, faces, len(MATERIALS) + i) for i, ((corners, faces, _), _) in enumerate(panels)]
    starts = np.cumsum([0, *(len(corners) for corners, _, _ in parts)])
    faces = np.concatenate([faces + start for (_, faces, _), start in zip(parts, starts[:-1], strict=True)])
    uvs = np.zeros((starts[-1], 2), np.float32)
    for i in range(len(panels)):
        start = starts[len(parts) - len(panels) + i]
        uvs[start : start + 4] = [(0, 0), (1, 0), (1, 1), (0, 1)]
    geometry = Geometry(
        positions=np.concatenate([corners for corners, _, _ in parts]),
        faces=faces.astype(np.int32),
        face_materials=np.repeat([m for _, _, m in parts], [len(f) for _, f, _ in parts]).astype(np.int32),
        uvs=uvs if textures else None,
    )
    models = (Model("room", 0, int(starts[-1])),)
    return Scene(name, Path(name), geometry, materials, textures, models, CAMERA, lights)


SPOTLIGHT = Spotlight((0.2, 2.3, 0.3), (-0.2, 0.0, -0.5), 110.0, (12.0, 11.0, 10.0))
POINT = Point((0.3, 2.1, 0.6), (4.0, 3.6, 3.0))
SPOT = Spot((1.2, 2.2, 1.2), (-0.4, 0.2, -0.7), 65.0, 30.0, (16.0, 14.0, 11.0))
SUN = Directional((2.0, 5.0, 2.5), (0.0, 0.0, 0.0), (6.0, 5.6, 5.0))
SOFT_SUN = Directional((2.0, 5.0, 2.5), (0.0, 0.0, 0.0), (6.0, 5.6, 5.0), angle=6.0)
RECT = Rect((0.4, 2.7, 0.2), (0.2, 0.0, -0.3), (1.2, 0.7), (0.0, 0.0, -1.0), (7.0, 6.5, 6.0))
DISC = Disc((-0.5, 2.7, -0.2), (-0.3, 0.0, -0.5), 0.5, (7.0, 7.5, 8.0))
SPHERE = Sphere((0.2, 3.0, 0.3), 0.35, (9.0, 8.0, 7.0))


def paint_sky() -> Array:
    """Return a sky as an image, float32 (64, 128, 3): a bright patch above, blue around it, dark ground."""
    y, x = (np.mgrid[:64, :128] + 0.5) * (np.pi / 64)
    up = np.cos(y)
    way = np.stack([-np.sin(y) * np.sin(x), up, np.sin(y) * np.cos(x)], axis=-1)
    patch = np.exp(40 * (way @ np.array([0.35, 0.87, 0.35]) / np.linalg.norm([0.35, 0.87, 0.35]) - 1))
    sky = np.where(up[..., None] > 0, (0.5, 0.7, 1.1) * (1.2 - 0.7 * up[..., None]), (0.2, 0.18, 0.15))
    image: Array = (sky + 12 * patch[..., None] * np.array([1.0, 0.9, 0.7])).astype(np.float32)
    return image


def _make_panels() -> Scene:
    """Build the room with its only light from panels: one on the ceiling, one with an image, one of two sides."""
    columns = np.clip(np.arange(32) % 8 * 40, 0, 255).astype(np.uint8)
    stripes = Texture("stripes", np.repeat(np.repeat(columns[None, :, None], 16, axis=0), 3, axis=2))
    ceiling = _quad((-0.6, 2.49, -1.2), (0.4, 2.49, -1.2), (0.4, 2.49, -0.4), 0)
    screen = _quad((-1.99, 0.9, 0.6), (-1.99, 0.9, -0.6), (-1.99, 1.7, -0.6), 0)
    sign = _quad((1.1, 1.5, -1.5), (1.6, 1.5, -1.2), (1.6, 2.1, -1.2), 0)
    black = (0.0, 0.0, 0.0)
    panels = (
        (ceiling, Material("ceiling panel", black, emission=(9.0, 8.5, 8.0))),
        (sign, Material("sign", black, emission=(1.5, 3.0, 1.5), emits_both_sides=True)),
        (screen, Material("screen", black, emission=(6.0, 6.0, 9.0), emission_texture=TextureRef(0))),
    )
    return _build("panels", (), ceiling=True, panels=panels, textures=(stripes,))


def _make_mixture() -> Scene:
    """Build the room with a light of every kind, each weaker than alone.

    Whatever hung above it would hide sun and sky elsewhere, so what has an area is mounted before black things inside.
    """
    import trimesh

    weak: Any = (
        Spotlight(SPOTLIGHT.position, SPOTLIGHT.look_at, SPOTLIGHT.fov, (3.0, 2.0, 2.0)),
        Point((-1.4, 1.9, 0.8), (0.6, 0.6, 0.9)),
        Spot(SPOT.position, SPOT.look_at, SPOT.fov, SPOT.inner_fov, (3.0, 4.0, 3.0)),
        Directional(SUN.position, SUN.look_at, (1.5, 1.3, 1.0)),
        Rect((-1.0, 1.8, 1.97), (-1.0, 1.8, 0.0), (0.9, 0.6), radiance=(1.5, 1.5, 1.0)),
        Disc((1.3, 1.7, 1.97), (1.3, 1.7, 0.0), 0.4, (1.5, 1.0, 1.5)),
        Sphere((-1.6, 2.1, 0.9), 0.2, (2.0, 2.0, 3.0)),
        Environment(image=paint_sky(), rotation=70.0, scale=0.2),
    )
    sign = _quad((1.1, 1.5, -1.5), (1.6, 1.5, -1.2), (1.6, 2.1, -1.2), 0)
    glow = Material("sign", (0.0, 0.0, 0.0), emission=(1.0, 2.0, 1.0), emits_both_sides=True)
    black = Material("mounting", (0.0, 0.0, 0.0))
    bulb = trimesh.creation.icosphere(3, radius=0.198)
    mountings = (
        _quad((-0.55, 1.5, 1.971), (-1.45, 1.5, 1.971), (-1.45, 2.1, 1.971), 0),
        _quad((1.7, 1.3, 1.971), (0.9, 1.3, 1.971), (0.9, 2.1, 1.971), 0),
        (np.add(bulb.vertices, (-1.6, 2.1, 0.9)), np.array(bulb.faces), 0),
    )
    return _build("mixture", weak, panels=((sign, glow), *((part, black) for part in mountings)))


SCENES: Mapping[str, Callable[[], Scene]] = {
    "spotlight": lambda: _build("spotlight", (SPOTLIGHT,), ceiling=True),
    "point": lambda: _build("point", (POINT,), ceiling=True),
    "spot": lambda: _build("spot", (SPOT,), ceiling=True),
    "directional": lambda: _build("directional", (SUN,)),
    "soft sun": lambda: _build("soft sun", (SOFT_SUN,)),
    "rect": lambda: _build("rect", (RECT,)),
    "disc": lambda: _build("disc", (DISC,)),
    "sphere": lambda: _build("sphere", (SPHERE,)),
    "open sky": lambda: _build("open sky", (Environment(image=paint_sky(), rotation=25.0),)),
    "grey sky": lambda: _build("grey sky", (Environment(radiance=(1.0, 1.1, 1.3)),)),
    "panels": _make_panels,
    "mixture": _make_mixture,
}
"""The scenes by name."""
