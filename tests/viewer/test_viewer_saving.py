"""What is saved: the picture on screen, a scene file, recorded motions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from PIL import Image
from virtual_display import act, cornell, frames, picture

from deferred_ir.cli import main
from deferred_ir.loading.load import load
from deferred_ir.viewer import saving
from deferred_ir.viewer.panels import side_panel as panels


def until_at_rest(viewer):
    """Draw frames until nothing changes any more, not even VPLs that are renewed over many frames."""
    assert any(not viewer.frame() for _ in range(100))


@pytest.mark.parametrize("graph", ["deferred", "incremental"])
def test_what_is_on_screen_is_saved(viewer, tmp_path, monkeypatch, graph):
    """Also where VPLs are renewed over many frames: a first frame has other pixels, and few VPLs."""
    monkeypatch.setattr(panels, "FOLDER", tmp_path)
    viewer.session.choose(graph)
    viewer.session.adjust("vpl.count", 32)
    viewer.session.adjust("tonemap.exposure", 0.75)
    for step in (0.1, 0.2):
        viewer.session.shine(replace(cornell().spotlight, position=(step, 0.9, -0.3)))
        viewer.session.look(replace(cornell().camera, position=(step, 0.273, -0.8)))
        frames(viewer, 4)
    until_at_rest(viewer)
    before = picture(viewer)
    act(viewer, "key", "ctrl+s")
    assert viewer.session.error == ""
    assert viewer.panel.saved.startswith("saved "), viewer.panel.saved
    assert np.array_equal(picture(viewer), before), "saving changes nothing on screen"
    with Image.open(tmp_path / "cornell-1.png") as saved:
        assert np.array_equal(np.asarray(saved), before)
    assert (tmp_path / "cornell-1.exr").exists()
    again = ["render", str(tmp_path / "cornell-1.toml"), "--device", "software", "-o", str(tmp_path / "again.png")]
    assert main.main(again) == 0
    with Image.open(tmp_path / "again.png") as again:
        assert np.array_equal(np.asarray(again), before) == (graph == "deferred")
    comment = (tmp_path / "cornell-1.toml").read_text().partition("name = ")[0]
    assert ("earlier frames left" in comment) == (graph == "incremental")


def test_a_second_picture_gets_a_name_of_its_own(viewer, tmp_path, monkeypatch):
    monkeypatch.setattr(panels, "FOLDER", tmp_path)
    act(viewer, "key", "ctrl+s")
    act(viewer, "key", "ctrl+s")
    assert sorted(path.name for path in tmp_path.glob("*.toml")) == ["cornell-1.toml", "cornell-2.toml"]


def test_a_name_with_brackets_is_not_written_over(tmp_path):
    """To a search for files they are a pattern."""
    (tmp_path / "hall[2]-1.png").touch()
    assert saving._find_free_stem(tmp_path, "hall[2]") == "hall[2]-2"


def test_a_recorded_way_is_saved_and_plays(viewer, tmp_path, monkeypatch):
    from deferred_ir.viewer.edits import recording as path

    monkeypatch.setattr(panels, "FOLDER", tmp_path)
    monkeypatch.setattr(path, "PERIOD", 0.0)
    session = viewer.session
    start = session.light
    session.switch_recording(True)
    viewer.frame()
    act(viewer, "keydown", "Right")
    act(viewer, "keyup", "Right")
    session.switch_recording(False)
    act(viewer, "key", "ctrl+s")
    saved = load(tmp_path / "cornell-1.toml")
    assert saved.spotlight.motion == session.scene.spotlight.motion is not None
    assert saved.camera.motion is None
    assert session.light == start
    session.playing = True
    frames(viewer, 3)
    assert session.light != start
