"""Small scenes with moving models, and the same scenes baked at one time."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from small_scenes import box, build, room, sphere

from deferred_ir.scene.motion import ModelMotion
from deferred_ir.scene.scene import Scene

WALLS = box((-1, -1, -1), (1, 1, 1))
BLOCK = box((-0.2, -0.3, -0.25), (0.3, 0.3, 0.15), (0.7, 0.2, 0.1))
BALL = sphere(0.25, 2, (0.1, 0.6, 0.3))
TURN = (0.0, float(np.sin(0.5)), 0.0, float(np.cos(0.5)))
AROUND = ModelMotion((0.0, 1.0), ((-0.4, -0.7, -0.3), (0.5, -0.5, 0.1)), ((0.0, 0.0, 0.0, 1.0), TURN))
UP = ModelMotion((0.0, 0.5, 2.0), ((0.4, -0.7, 0.2), (0.4, 0.0, 0.0), (-0.5, 0.2, -0.4)), ((0.0, 0.0, 0.0, 1.0),) * 3)
VIEW = {"camera": room().camera, "spotlight": room().spotlight}


def room_with_moving_models() -> Scene:
    """A room in which a block and a smooth ball move."""
    return build(WALLS, BLOCK, BALL, motions=(None, AROUND, UP), **VIEW)


def room_with_moving_block() -> Scene:
    """A room in which only a block moves."""
    return build(WALLS, BLOCK, motions=(None, AROUND), **VIEW)


def bake(scene: Scene, time: float) -> Scene:
    """A scene without motion whose models stand where those of `scene` are at `time`; its extent is that of `scene`."""
    there = scene.at(time)
    geometry = replace(scene.geometry, positions=there.geometry.positions, normals=there.geometry.normals, moving=())
    geometry.__dict__.update(extent=scene.geometry.extent)
    return replace(scene, geometry=geometry)


def pose_matrix(vector: Any, shift: Any) -> np.ndarray:
    """A rotation about `vector` by its length in radians, then a translation, (4, 4)."""
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = Rotation.from_rotvec(vector).as_matrix(), shift
    return matrix


NUMBERS = st.floats(-1, 1)
VECTORS = st.tuples(NUMBERS, NUMBERS, NUMBERS)
