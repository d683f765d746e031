"""Cameras and spotlights chosen for scenes that have none."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh

from deferred_ir.loading import load as loading
from deferred_ir.rays.tracer import Tracer
from deferred_ir.scene.scene import Scene


def room(*things: trimesh.Trimesh, size: tuple[float, float, float] = (6, 3, 4)) -> trimesh.Trimesh:
    """A closed room whose walls face inwards, with things in it."""
    walls = trimesh.creation.box(size)
    inwards = trimesh.Trimesh(walls.vertices, walls.faces[:, ::-1], process=False)
    return trimesh.util.concatenate([inwards, *things])


def load(folder: Path, mesh: trimesh.Trimesh, tables: str = "") -> Scene:
    mesh.export(folder / "model.stl")
    if not tables:
        return loading.load(folder / "model.stl")
    (folder / "scene.toml").write_text(f'[[model]]\npath = "model.stl"\n{tables}')
    return loading.load(folder / "scene.toml")


def camera_hits(scene: Scene, side: int = 96) -> tuple[Tracer, np.ndarray, np.ndarray, np.ndarray]:
    tracer = Tracer(scene)
    directions = scene.camera.rays((side, side)).reshape(-1, 3)
    hits = tracer.closest(np.tile(scene.camera.position, (len(directions), 1)), directions)
    return tracer, hits.hit, hits.position, hits.normal


def mean_irradiance(scene: Scene) -> float:
    """Compute it by the formula of the light model, at other points than those of the choice."""
    tracer, hit, position, normal = camera_hits(scene)
    position, normal = tracer.lift(position[hit], normal[hit]), normal[hit]
    light = scene.spotlight
    way = position - np.array(light.position)
    distance = np.linalg.norm(way, axis=1)
    towards = way / distance[:, None]
    half = np.cos(np.radians(light.fov / 2))
    off_axis = towards @ light.axis
    intensity = light.emission[0] * off_axis.clip(0) * ((off_axis - half) * 4 / (1 - half)).clip(0, 1)
    free = ~tracer.occluded(position, np.tile(light.position, (len(position), 1)))
    return float((intensity * (-(normal * towards).sum(axis=1)).clip(0) * free / distance**2).mean())


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_a_room_is_seen_from_inside_at_any_scale(tmp_path: Path, scale: float) -> None:
    mesh = room(trimesh.creation.icosphere(radius=0.7))  # the ball is where the middle of the bounds is
    mesh.apply_scale(scale)
    scene = load(tmp_path, mesh)
    low, high = scene.geometry.bounds
    for place in (scene.camera.position, scene.spotlight.position):
        assert (place > low).all()
        assert (place < high).all()
        assert np.linalg.norm(place) > 0.7 * scale  # not within the ball
    _, hit, position, _ = camera_hits(scene)
    assert hit.all()
    assert np.median(np.linalg.norm(position - scene.camera.position, axis=1)) > 2 * scale
    assert mean_irradiance(scene) == pytest.approx(1, rel=0.03)
    assert scene.chosen["camera"]["why"] == "inside, looking across"


def test_a_room_with_an_open_side_is_seen_from_inside(tmp_path: Path) -> None:
    mesh = room(size=(2, 2, 2))
    mesh.update_faces(mesh.triangles_center[:, 2] < 0.99)
    scene = load(tmp_path, mesh)
    _, hit, _, _ = camera_hits(scene)
    assert hit.mean() > 0.95
    assert mean_irradiance(scene) == pytest.approx(1, rel=0.03)


@pytest.mark.parametrize(
    "mesh",
    [
        trimesh.creation.icosphere(),
        trimesh.creation.box((1, 5, 0.2)),
        trimesh.creation.torus(1, 0.3),
        trimesh.util.concatenate(
            [trimesh.creation.box((9, 0.1, 9)), trimesh.creation.icosphere().apply_translation([0, 1.2, 0])]
        ),
        trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [0, 0, 1]], [[0, 1, 2]], process=False),
    ],
    ids=["ball", "board", "ring", "ball on a floor", "triangle"],
)
def test_an_object_is_seen_whole_from_outside(tmp_path: Path, mesh: trimesh.Trimesh) -> None:
    scene = load(tmp_path, mesh)
    assert scene.chosen["camera"]["why"] == "from outside, framing the whole"
    right, up, forward = scene.camera.axes
    ways = scene.geometry.positions - np.array(scene.camera.position)
    tangents = np.abs(np.stack([ways @ right, ways @ up])) / (ways @ forward)
    assert (ways @ forward > 0).all()
    assert 0.5 < tangents.max() / np.tan(np.radians(scene.camera.fov / 2)) < 1
    _, hit, _, _ = camera_hits(scene)
    assert hit.mean() > 0.02
    to_light = scene.geometry.positions - np.array(scene.spotlight.position)
    angles = np.degrees(np.arccos(to_light @ scene.spotlight.axis / np.linalg.norm(to_light, axis=1)))
    assert angles.max() < scene.spotlight.fov / 2
    assert mean_irradiance(scene) == pytest.approx(1, rel=0.03)


def test_a_box_on_the_ground_is_seen_from_outside(tmp_path: Path) -> None:
    """The middle of the bounds is in the box, whose bottom coincides with the ground."""
    ground = trimesh.Trimesh([(-3, 0, -3), (-3, 0, 3), (3, 0, 3), (3, 0, -3)], [(0, 1, 2), (0, 2, 3)], process=False)
    box = trimesh.creation.box((1, 1, 1))
    box.apply_translation((0, 0.5, 0))
    scene = load(tmp_path, trimesh.util.concatenate([ground, box]))
    assert "outside" in scene.chosen["camera"]["why"]


def test_what_the_file_says_stays(tmp_path: Path) -> None:
    camera = "[camera]\nposition = [2, 0, 1]\nlook_at = [0, -1, 0]\nfov = 50\n"
    scene = load(tmp_path, room(), camera)
    assert scene.camera.position == (2, 0, 1)
    assert list(scene.chosen) == ["spotlight"]
    assert mean_irradiance(scene) == pytest.approx(1, rel=0.03)
    light = "[spotlight]\nposition = [0, 1, 0]\nlook_at = [0, 0, 0]\nemission = [7, 7, 7]\n"
    scene = load(tmp_path, room(), light)
    assert scene.spotlight.emission == (7, 7, 7)
    assert list(scene.chosen) == ["camera"]
    assert load(tmp_path, room(), camera + light).chosen == {}


def test_a_camera_between_walls_gets_a_light_there(tmp_path: Path) -> None:
    # The camera looks at the outside of a room: the light must not be in it.
    camera = "[camera]\nposition = [9, 1, 9]\nlook_at = [0, 0, 0]\n"
    scene = load(tmp_path, room(), camera)
    assert mean_irradiance(scene) == pytest.approx(1, rel=0.03)


def test_a_light_that_reaches_nothing_goes_to_the_camera(tmp_path: Path) -> None:
    # From inside a solid, no light outside reaches what is seen.
    camera = "[camera]\nposition = [0.1, 0, 0]\nlook_at = [1, 0, 0]\n"
    scene = load(tmp_path, trimesh.creation.box(), camera)
    assert scene.spotlight.position == scene.camera.position
    assert scene.chosen["spotlight"]["why"].startswith("at the camera")
    assert mean_irradiance(scene) == pytest.approx(1, rel=0.03)


def test_a_camera_that_sees_nothing(tmp_path: Path) -> None:
    camera = "[camera]\nposition = [9, 0, 0]\nlook_at = [19, 0, 0]\n"
    scene = load(tmp_path, trimesh.creation.box(), camera)
    assert scene.chosen["spotlight"]["why"].startswith("the camera sees nothing")
    assert scene.spotlight.emission[0] > 0


def test_the_choice_is_repeatable_and_fits_into_json(tmp_path: Path) -> None:
    mesh = room(trimesh.creation.box())
    first, second = load(tmp_path, mesh), load(tmp_path, mesh)
    assert first.chosen == second.chosen
    assert first.hash == second.hash
    assert json.loads(json.dumps(first.chosen)) == first.chosen
    assert first.chosen["camera"]["position"] == list(first.camera.position)
    assert first.chosen["spotlight"]["emission"] == list(first.spotlight.emission)


def test_without_embree_the_bounds_decide(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "embreex", None)
    scene = load(tmp_path, trimesh.creation.icosphere())
    assert "without embreex" in scene.chosen["camera"]["why"]
    light = scene.spotlight
    distance = np.linalg.norm(np.subtract(light.look_at, light.position))
    assert light.emission[0] / distance**2 == pytest.approx(1)
