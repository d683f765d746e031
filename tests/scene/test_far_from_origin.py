"""Scenes far from the origin are moved to it, where 32-bit floats are fine enough."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from small_scenes import FAR, move_away

from deferred_ir import load
from deferred_ir.engine.renderer import Renderer
from deferred_ir.scene.camera import Camera
from deferred_ir.scene.motion import CameraMotion
from deferred_ir.scene.recentre import recentre
from deferred_ir.truth.metrics import relmse
from deferred_ir.truth.reference import trace_reference


def test_a_scene_near_the_origin_stays_as_it_is() -> None:
    scene = load("cornell")
    assert recentre(scene) is scene
    assert move_away(scene, (2.0, 0.0, 0.0)).geometry.centre == (0, 0, 0)


def test_a_scene_far_away_is_moved_in_64_bits() -> None:
    scene, far = load("cornell"), move_away(load("cornell"))
    near = recentre(far)
    middle = scene.geometry.middle
    assert recentre(near) is near
    assert near.geometry.positions == pytest.approx(scene.geometry.positions - middle, abs=1e-10)
    assert near.camera.position == pytest.approx(np.subtract(scene.camera.position, middle), abs=1e-10)
    assert near.spotlight.look_at == pytest.approx(np.subtract(scene.spotlight.look_at, middle), abs=1e-10)
    assert recentre(far).geometry is near.geometry  # uploaded once


@pytest.mark.parametrize("graph", ["deferred", "accurate", "forward"])
def test_a_picture_is_the_same_far_from_the_origin(renderer, graph: str) -> None:
    scene = load("cornell")
    made: Renderer = renderer((64, 64), graph, set={"vpl.count": 8})
    near, far = made.render(scene).radiance, made.render(move_away(scene)).radiance
    assert relmse(far, near)[0] < 1e-5


def test_a_reference_is_the_same_far_from_the_origin() -> None:
    scene = load("cornell")
    near, far = (trace_reference(each, (32, 32), vpls=8).radiance for each in (scene, move_away(scene)))
    assert relmse(far, near)[0] < 1e-5


def test_a_moving_camera_far_from_the_origin(renderer) -> None:
    scene = load("cornell")
    position, look_at = scene.camera.position, scene.camera.look_at
    there = tuple(np.add(position, (0.1, 0.0, 0.0)).tolist())
    motion = CameraMotion((0.0, 1.0), (position, there), (look_at, look_at))
    far = move_away(scene)
    shifted = CameraMotion(
        (0.0, 1.0), *(tuple(tuple(np.add(p, FAR)) for p in ps) for ps in ((position, there), (look_at, look_at)))
    )
    made: Renderer = renderer((48, 48), set={"vpl.count": 4})
    one = made.render(replace(scene, camera=replace(scene.camera, motion=motion)), time=0.5).radiance
    other = made.render(replace(far, camera=replace(far.camera, motion=shifted)), time=0.5).radiance
    assert relmse(other, one)[0] < 1e-5


def test_what_is_chosen_for_a_model_far_away_lies_there(tmp_path: Path) -> None:
    triangle = "v {0} 0 0\nv {1} 0 0\nv {0} 1 0\nf 1 2 3\n"
    (tmp_path / "near.obj").write_text(triangle.format(0, 1))
    (tmp_path / "far.obj").write_text(triangle.format(10**8, 10**8 + 1))
    near, far = load(tmp_path / "near.obj"), load(tmp_path / "far.obj")
    assert isinstance(far.camera, Camera)
    assert np.subtract(far.camera.position, (1e8, 0, 0)) == pytest.approx(near.camera.position, abs=1e-4)
    assert np.subtract(far.spotlight.position, (1e8, 0, 0)) == pytest.approx(near.spotlight.position, abs=1e-4)
    assert far.spotlight.emission == pytest.approx(near.spotlight.emission, rel=1e-4)
    assert far.chosen["camera"]["position"] == list(far.camera.position)


@pytest.mark.parametrize("shift", [(0.0, 0.0), (10000.0, -30000.0), (1e7, 2e7)])
def test_texture_coordinates_far_out_are_moved_home_by_whole_numbers(
    tmp_path: Path, shift: tuple[float, float]
) -> None:
    from PIL import Image

    Image.new("RGB", (2, 2), (255, 0, 0)).save(tmp_path / "i.png")
    (tmp_path / "m.mtl").write_text("newmtl m\nmap_Kd i.png\n")
    plain = np.array([[0.125, 0.25], [0.6, 0.3], [0.7, 1.1]])
    text = "".join(f"vt {u!r} {v!r}\n" for u, v in (plain + shift).tolist())
    (tmp_path / "m.obj").write_text(f"mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\n{text}usemtl m\nf 1/1 2/2 3/3\n")
    uvs = load(tmp_path / "m.obj").geometry.uvs
    assert uvs is not None
    away_by = uvs - plain
    assert away_by == pytest.approx(np.round(away_by), abs=1e-7 if shift == (0, 0) else 1e-6)
    assert np.abs(uvs).max() < 2
