"""Scenes changed for the study of retained VPLs: a light that moves or stands still, and a ball that moves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from deferred_ir.base.arrays import Array
from deferred_ir.scene.geometry import Geometry, Model
from deferred_ir.scene.motion import LissajousMotion, ModelMotion
from deferred_ir.scene.scene import Scene
from deferred_ir.scene.surfaces.materials import Material

BALL = 0.06
"""Radius of the moving ball, in diagonals of the scene."""


def move_light(scene: Scene) -> Scene:
    """Let the light move to and fro by a tenth of the scene's diagonal in 8 seconds, unless it has a motion."""
    light = scene.spotlight
    if light.motion:
        return scene
    x, y, z = (fraction * scene.geometry.diagonal for fraction in (0.05, 0.01, 0.05))
    start = light.position[0] - x, light.position[1] - y, light.position[2]  # so it is in its place at time 0
    return replace(scene, lights=(replace(light, position=start, motion=LissajousMotion((x, y, z), (0.8, 0.5))),))


def hold_light(scene: Scene) -> Scene:
    """Let the light stay where it is at time 0."""
    return replace(scene, lights=(replace(scene.spotlight.at(0), motion=None),))


def add_moving_ball(scene: Scene) -> Scene:
    """Add a ball that crosses the middle half of the scene's width in 4 seconds; light and camera stand still."""
    import trimesh

    scene, geometry = hold_light(scene), scene.geometry
    ball, count = trimesh.creation.icosphere(3, radius=BALL * geometry.diagonal), len(geometry.positions)
    new = len(ball.vertices)
    low, high = geometry.bounds
    across, middle = np.array([(high - low)[0] / 4, 0, 0]), (low + high) / 2
    ends = tuple((x, y, z) for x, y, z in (middle - across, middle + across))
    model = Model("ball", count, new, ModelMotion((0.0, 4.0), ends, ((0.0, 0.0, 0.0, 1.0),) * 2))

    def extend(values: Array | None, filler: float) -> Array | None:
        if values is None:
            return None
        return np.concatenate([values, np.full((new, values.shape[1]), filler, values.dtype)])

    geometry = Geometry(
        positions=np.concatenate([geometry.positions, ball.vertices]),
        # Faces without a texture come first.
        faces=np.concatenate([ball.faces + count, geometry.faces]).astype(np.int32),
        face_materials=np.append(np.full(len(ball.faces), len(scene.materials)), geometry.face_materials).astype("i4"),
        normals=extend(geometry.normals, 0),
        uvs=extend(geometry.uvs, 0),
        colors=extend(geometry.colors, 1),
        second_uvs=extend(geometry.second_uvs, 0),
        tangents=extend(geometry.tangents, 0),
        moving=(model,),
    )
    materials = (*scene.materials, Material("ball", (0.7, 0.7, 0.7)))
    return replace(scene, geometry=geometry, materials=materials, models=(*scene.models, model))
