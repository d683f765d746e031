"""`load`: names, scene files and model files."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from deferred_ir.base.errors import SceneError
from deferred_ir.loading import load

OBJ = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
TABLES = """
[camera]
position = [0, 0, 3]
look_at = [0, 0, 0]
[spotlight]
position = [0, 1, 3]
look_at = [0, 0, 0]
emission = [9, 9, 9]
"""


def scene_file(folder: Path, models: str = '[[model]]\npath = "t.obj"\n', tables: str = TABLES) -> Path:
    (folder / "t.obj").write_text(OBJ)
    (folder / "own.toml").write_text(models + tables)
    return folder / "own.toml"


def test_builtin_scenes_have_descriptions_and_load() -> None:
    described = dict(load.builtin_scenes())
    assert {"cornell", "colors"} <= set(described)
    assert all(text and "\n" not in text for text in described.values())
    for name in described:
        scene = load.load(name)
        assert scene.name == name
        assert scene.chosen == {}
        assert len(scene.geometry.faces) > 0


def test_a_scene_file(tmp_path: Path) -> None:
    path = scene_file(tmp_path)
    scene = load.load(str(path))
    assert (scene.name, scene.path) == ("own", path)
    assert scene.models[0].name == "t"
    assert load.load(path).hash == scene.hash
    assert (scene.chosen, scene.notes) == ({}, ())


def test_model_paths_are_relative_to_the_scene_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scene_file(tmp_path)
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    assert load.load("../own.toml").name == "own"


def test_several_models_are_placed(tmp_path: Path) -> None:
    models = '[[model]]\npath = "t.obj"\n[[model]]\npath = "t.obj"\nscale = 2\ntranslate = [10, 0, 0]\n'
    models += "[model.motion]\ntimes = [0]\ntranslations = [[0, 0, 0]]\nrotations = [[0, 0, 0, 2]]\n"
    scene = load.load(scene_file(tmp_path, models))
    assert scene.geometry.bounds == pytest.approx(np.array([[0, 0, 0], [12, 2, 0]]))
    assert [(model.first_vertex, model.vertex_count) for model in scene.models] == [(0, 3), (3, 3)]
    assert scene.models[0].motion is None
    assert scene.models[1].motion is not None
    assert scene.models[1].motion.rotations == ((0, 0, 0, 1),)


def test_a_bare_model(tmp_path: Path) -> None:
    scene_file(tmp_path)
    scene = load.load(tmp_path / "t.obj")
    assert scene.name == "t"
    assert set(scene.chosen) == {"camera", "spotlight"}


def test_a_builtin_name_wins_over_a_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "cornell").write_text("no scene")
    assert load.load("cornell").name == "cornell"


def test_unknown_names(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=r"cornel: no such file and no built-in .*; did you mean 'cornell'\?"):
        load.load("cornel")
    with pytest.raises(SceneError, match=r"none\.toml: no such file; give a scene file, a model, or a built-in scene"):
        load.load(tmp_path / "none.toml")
    with pytest.raises(SceneError, match=r"none\.obj: no such file"):
        load.load("none.obj")
    with pytest.raises(SceneError, match="is a folder; give a scene file"):
        load.load(tmp_path)
    with pytest.raises(SceneError, match="no such file"):
        load.load("a\0b" * 3000)


def test_faults_of_a_model_name_scene_file_and_key(tmp_path: Path) -> None:
    path = scene_file(tmp_path, '[[model]]\npath = "gone.obj"\n')
    with pytest.raises(SceneError, match=r"own\.toml: model\.path: .*gone\.obj: cannot be read: No such file"):
        load.load(path)
    (tmp_path / "points.obj").write_text("v 0 0 0\n")
    path = scene_file(tmp_path, '[[model]]\npath = "t.obj"\n[[model]]\npath = "points.obj"\n')
    with pytest.raises(SceneError, match=r"own\.toml: model\[1\]\.path: .*points\.obj: no triangles"):
        load.load(path)


def test_an_unreadable_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = scene_file(tmp_path)

    def refuse(self: Path) -> bytes:
        raise PermissionError(13, "Permission denied", str(self))

    monkeypatch.setattr(Path, "read_bytes", refuse)
    with pytest.raises(SceneError, match=r"own\.toml: cannot be read: Permission denied"):
        load.load(path)
    with pytest.raises(SceneError, match=r"t\.obj: cannot be read: Permission denied; check"):
        load.load(tmp_path / "t.obj")


def test_importing_it_is_light() -> None:
    heavy = ("trimesh", "scipy", "PIL", "embreex")
    code = f"import sys, deferred_ir.loading.load; print([name for name in {heavy} if name in sys.modules])"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout.strip() == "[]"
