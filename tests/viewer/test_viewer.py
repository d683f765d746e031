"""The viewer in a real window on a virtual display: real keys and mouse, and the pixels of the window."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from virtual_display import FEW, SIZE, act, cornell, picture, rendered, xdo

from deferred_ir.cli import main
from deferred_ir.viewer.controls import KEYS
from deferred_ir.viewer.panels.side_panel import WIDTH


def test_the_picture_on_screen_is_the_one_that_render_makes(viewer):
    expected = rendered(cornell(), set=FEW)
    assert np.array_equal(picture(viewer), expected)


def test_the_command_ends_by_itself_and_writes_the_window(screen, tmp_path):
    options = ["cornell", "--size", "64x48", "--vpls", "4"]
    command = [sys.executable, "-m", "deferred_ir", "view", *options, "--frames", "2"]
    subprocess.run([*command, "--screenshot", tmp_path / "w.png"], check=True)
    assert main.main(["render", *options, "--device", "software", "-o", str(tmp_path / "r.png")]) == 0
    with Image.open(tmp_path / "w.png") as window, Image.open(tmp_path / "r.png") as render:
        assert window.size == (64 + WIDTH, 48)
        assert np.array_equal(np.asarray(window)[:, :64], np.asarray(render))


def test_without_a_display_it_names_render():
    environment = {key: value for key, value in os.environ.items() if key not in ("DISPLAY", "WAYLAND_DISPLAY")}
    command = [sys.executable, "-m", "deferred_ir", "view"]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr.startswith("deferred-ir: view: no display (")
    assert done.stderr.count("\n") == 1
    assert "deferred-ir render" in done.stderr


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--screenshot", "a.png"], "--screenshot: wants --frames N"),
        (["--screenshot", "a.jpg", "--frames", "1"], "a.jpg: a screenshot is written as .png"),
    ],
)
def test_options_that_make_no_sense_are_told(options, message, capsys):
    assert main.main(["view", *options]) == 2
    assert message in capsys.readouterr().err


@pytest.mark.parametrize(("key", "scene"), [(2, "atrium"), (3, "colors"), (1, "cornell")])
def test_number_keys_load_scenes(viewer, key, scene):
    act(viewer, "key", key)
    assert viewer.session.scene.name == scene
    assert viewer.session.error == ""


@pytest.mark.parametrize(("key", "axis", "sign"), [("w", 2, 1), ("s", 2, -1), ("d", 0, 1), ("a", 0, -1), ("e", 1, 1)])
def test_keys_fly_the_camera_along_its_axes(viewer, key, axis, sign):
    before = viewer.session.camera
    act(viewer, "keydown", key)
    act(viewer, "keyup", key)
    step = before.axes @ np.subtract(viewer.session.camera.position, before.position)
    assert sign * step[axis] > 0
    assert np.allclose(np.delete(step, axis), 0)
    assert np.array_equal(picture(viewer), rendered(replace(cornell(), camera=viewer.session.camera), set=FEW))


def test_the_mouse_turns_the_camera(viewer):
    before = viewer.session.camera
    xdo("mousemove", 40, 40)
    act(viewer, "mousedown", 1)
    act(viewer, "mousemove", 60, 40)
    act(viewer, "mouseup", 1)
    after = viewer.session.camera
    assert after.position == before.position
    right, up, _ = before.axes
    assert after.axes[2] @ right > 0.05
    assert abs(after.axes[2] @ up) < 1e-9


def test_the_mouse_over_the_panel_leaves_the_camera_alone(viewer):
    before = viewer.session.camera
    act(viewer, "mousemove", SIZE[0] + 200, 40)
    act(viewer, "mousedown", 1)
    act(viewer, "mousemove", SIZE[0] + 220, 45)
    act(viewer, "mouseup", 1)
    assert viewer.session.camera == before


def test_tab_hides_the_panel_and_the_picture_takes_its_place(viewer):
    act(viewer, "key", "Tab")
    assert viewer.session.size == (SIZE[0] + WIDTH, SIZE[1])
    act(viewer, "key", "Tab")
    assert viewer.session.size == SIZE


def test_the_documentation_has_the_table_of_keys():
    page = (Path(__file__).resolve().parents[2] / "docs" / "viewer.md").read_text()
    table = page.partition("## Keys and mouse")[2].partition("##")[0]
    rows = re.findall(r"^\| (.+) \| (.+) \|$", table, re.MULTILINE)
    assert rows == [(binding.label, binding.text) for binding in KEYS]
