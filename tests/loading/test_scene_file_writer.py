"""What is written as a scene file is read back as it was."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from deferred_ir.loading import scene_file, scene_file_writer
from deferred_ir.loading.material_tables import MaterialOverride
from deferred_ir.loading.scene_file import ModelEntry, SceneFile
from deferred_ir.scene.camera import Camera
from deferred_ir.scene.lights.directional import Directional
from deferred_ir.scene.lights.disc import Disc
from deferred_ir.scene.lights.environment import Environment
from deferred_ir.scene.lights.point import Point
from deferred_ir.scene.lights.rect import Rect
from deferred_ir.scene.lights.sphere import Sphere
from deferred_ir.scene.lights.spot import Spot
from deferred_ir.scene.lights.spotlight import Spotlight
from deferred_ir.scene.motion import CameraMotion, KeyframedLight, LissajousMotion, ModelMotion
from deferred_ir.scene.scene import RenderDefaults

A, B = (0.1, 0.2, 1e-9), (1.0, -2.5, 3e7)
MOTION = ModelMotion((0.0, 2.0), (A, B), ((0.0, 0.0, 0.0, 1.0), (0.0, 1.0, 0.0, 0.0)))
CAMERA = Camera(A, B, (0.6, 0.8, 0.0), 33.25, CameraMotion((0.0, 1.0), (A, B), (B, A)))
LIGHT = Spotlight(A, B, 71.5, (1.0, 0.0, 1e6), 0.25, LissajousMotion((0.1, 0.0, 0.2), (1.0, 2.0)))
KEYFRAMED = replace(LIGHT, motion=KeyframedLight((0.0, 0.5, 3.0), (A, B, A), (B, A, B)))
LIGHTS = (
    Point(A, (1.0, 2.0, 3.0), 0.5, KeyframedLight((0.0, 1.0), (A, B))),
    Spot(A, B, 60.0, 20.0, (1.0, 0.0, 2.0), LissajousMotion((0.1, 0.0, 0.2), (1.0, 2.0))),
    Directional(A, B, (1.0, 0.5, 0.25), 0.5),
    Rect(A, B, (0.5, 1.5), (0.0, 1.0, 0.0), (1.0, 2.0, 3.0)),
    Disc(A, B, 0.25, (1.0, 2.0, 3.0)),
    Sphere(A, 0.25, (1.0, 2.0, 3.0)),
    Environment(radiance=(0.5, 0.5, 1.0), rotation=30.0, scale=2.0),
    LIGHT,
)
MODELS = (ModelEntry(Path("/models/a b.obj"), 0.5, A, MOTION), ModelEntry(Path("/models/ü.glb"), lights=False))
RENDER = RenderDefaults("accurate", (640, 480), 32, 7, {"tonemap.exposure": "auto", "vpl.clamp": 0.1, "vpl.bounces": 2})

MATERIALS = {
    "red wall": MaterialOverride((0.5, 0.0, 1.0), 0.25, 0.0, (1e6, 0.0, 0.5), 0.5, 1.33, 0.1, -2.0),
    'a "b" ü.\\': MaterialOverride(roughness=0.125),
    "plain": MaterialOverride(),
}


@pytest.mark.parametrize(
    "scene",
    [
        SceneFile("hall", MODELS, CAMERA, (LIGHT, *LIGHTS), RENDER, MATERIALS),
        SceneFile("hall", MODELS, replace(CAMERA, motion=None), (KEYFRAMED,), RenderDefaults("/graphs/mine.toml")),
        SceneFile("ü [2] \"quoted\" #", MODELS[1:]),
    ],
    ids=["everything", "other kinds", "least"],
)  # fmt: skip
def test_what_is_written_is_read_back(scene: SceneFile, tmp_path: Path) -> None:
    scene_file_writer.write(tmp_path / "scene.toml", scene, "first line\nsecond line")
    assert scene_file.read(tmp_path / "scene.toml") == scene
    lines = (tmp_path / "scene.toml").read_text(encoding="utf-8").splitlines()
    assert lines[:2] == ["# first line", "# second line"]


def test_relative_paths_hang_on_the_files_folder(tmp_path: Path) -> None:
    scene = SceneFile("hall", (ModelEntry(Path("a.obj")),), render=RenderDefaults("mine.toml"))
    scene_file_writer.write(tmp_path / "scene.toml", scene)
    read = scene_file.read(tmp_path / "scene.toml")
    assert read.models[0].path == tmp_path / "a.obj"
    assert read.render.graph == str(tmp_path / "mine.toml")
