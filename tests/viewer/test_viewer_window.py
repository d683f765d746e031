"""What happens to a window: files are dropped on it, it is minimised, made tiny, closed at any time; and it answers."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
import pytest
from virtual_display import FEW, SIZE, act, cornell, frames, picture, rendered, xdo
from x_client import Client

from deferred_ir.loading.load import load
from deferred_ir.viewer import app


@pytest.fixture
def client(viewer):
    with Client() as made:
        yield made


def identity(viewer):
    import glfw

    return glfw.get_x11_window(viewer.window._window)


def drop(viewer, client, *paths):
    client.drop(identity(viewer), paths, lambda: viewer.frame(0.01))
    viewer.frame()


def test_dropped_files_are_loaded_and_what_fails_leaves_the_picture(viewer, client, tmp_path):
    before = picture(viewer)
    broken = {
        "broken.toml": "name = 3",
        "empty.obj": "",
        "model.toml": '[[model]]\npath = "gone.obj"\n',
        "picture.png": "no picture",
        "graph.toml": '[passes.tonemapp]\n[outputs]\ndisplay = "tonemapp.color"\n',
    }
    for name, text in broken.items():
        (tmp_path / name).write_text(text)
        drop(viewer, client, tmp_path / name)
        assert viewer.session.error, name
        assert name in viewer.session.error or "gone.obj" in viewer.session.error
        assert np.array_equal(picture(viewer), before)
    scene = tmp_path / "a scene.toml"
    scene.write_text(f'name = "dropped"\n[[model]]\npath = "{load("colors").path.parent / "colors.obj"}"\n')
    drop(viewer, client, scene)
    assert viewer.session.error == ""
    assert viewer.session.scene.name == "dropped"
    graph = tmp_path / "flat.toml"
    graph.write_text('extends = "deferred"\n[passes.tonemap]\noperator = "none"\n')
    drop(viewer, client, graph, load("colors").path)
    assert viewer.session.error == ""
    assert viewer.session.scene.name == "colors"
    assert viewer.session.renderer.graph().nodes["tonemap"].work.params.operator == "none"


def test_a_minimised_window_waits_and_comes_back_as_it_was(viewer, client, monkeypatch):
    before = picture(viewer)
    client.minimise(identity(viewer))
    frames(viewer, 2)
    assert viewer.window.minimised
    viewer.session.playing = True
    seen = []
    monkeypatch.setattr(viewer.session, "draw", lambda: seen.append(1))
    monkeypatch.setattr(app, "IDLE", 0.05)
    start, count = time.perf_counter(), viewer.frames
    monkeypatch.setattr(type(viewer.window), "closing", property(lambda _: viewer.frames >= count + 4))
    viewer.run()
    assert time.perf_counter() - start >= 3 * 0.05, "it waits for input, whatever would play"
    assert not seen
    monkeypatch.undo()
    viewer.session.playing = False
    client.restore(identity(viewer))
    frames(viewer)
    assert not viewer.window.minimised
    assert np.array_equal(picture(viewer), before)


@pytest.mark.parametrize("size", [(1, 1), (700, 200), (200, 1)])
def test_the_picture_follows_the_window(viewer, size):
    viewer.window.resize(size)
    frames(viewer, 3)
    assert viewer.window.size == size
    area = viewer.area()
    assert viewer.session.size == (area.width, area.height)
    assert viewer.session.error == ""


def test_a_window_is_closed_while_a_reference_is_traced(viewer, client):
    viewer.panel.reference._spp = 3
    viewer.panel.reference.start()
    frames(viewer, 2)
    assert viewer.panel.reference.job.running
    client.close(identity(viewer))
    start = time.perf_counter()
    viewer.run()
    assert viewer.window.closing
    viewer.panel.close()
    assert not viewer.panel.reference.job.running
    assert time.perf_counter() - start < 10, "it does not wait for the reference"
    import glfw

    glfw.set_window_should_close(viewer.window._window, False)


def test_a_frame_shows_all_input_that_came_before_it(viewer):
    """However slow frames are: what came while one was drawn is in the next, all of it, and no frame later."""
    session, light = viewer.session, viewer.session.light
    act(viewer, "mousemove", 40, 40)
    act(viewer, "mousedown", 3, frames=1)
    for x in (42, 47, 55, 60):
        xdo("mousemove", "--sync", x, 40)
    assert viewer.frame(0.05)
    step = session.camera.axes @ np.subtract(session.light.position, light.position)
    assert step[0] == pytest.approx(20 * session.scene.geometry.diagonal / 2 / SIZE[1])
    expected = replace(cornell(), lights=(session.light,))
    assert np.array_equal(picture(viewer), rendered(expected, set=FEW))
    act(viewer, "mouseup", 3)
    before = session.camera
    xdo("keydown", "d")
    assert viewer.frame(0.05)
    assert session.camera != before
    assert np.array_equal(picture(viewer), rendered(replace(expected, camera=session.camera), set=FEW))
    act(viewer, "keyup", "d")


def test_a_window_waits_while_nothing_changes_and_wakes_at_once(viewer):
    frames(viewer, 3)
    assert not viewer.frame()
    xdo("keydown", "w")
    start = time.perf_counter()
    assert viewer.frame(5.0)
    assert time.perf_counter() - start < 2.0
    act(viewer, "keyup", "w")
