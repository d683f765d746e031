"""The list of lights in a real window: by mouse and keys, drawn as outlines, saved and played."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from PIL import Image
from virtual_display import FEW, SIZE, Spy, act, arrange, cornell, frames, middle, picture, rendered

from deferred_ir.cli import main
from deferred_ir.loading.load import load
from deferred_ir.scene.lights.kinds import find_kinds
from deferred_ir.scene.lights.point import Point
from deferred_ir.scene.lights.spot import Spot
from deferred_ir.scene.motion import KeyframedLight
from deferred_ir.viewer.panels import side_panel as panels
from deferred_ir.viewer.panels.light_outlines import ON, SELECTED, find_outlines
from deferred_ir.viewer.panels.lines import find_hidden, project
from deferred_ir.viewer.panels.side_panel import WIDTH

KINDS = find_kinds()
BLUE = Point((0.1, 0.3, -0.1), (0.0, 0.1, 0.5))


@pytest.fixture
def tall(viewer):
    viewer.window.resize((64 + WIDTH, 900))
    frames(viewer, 2)
    arrange(viewer, "Lights")
    yield viewer
    arrange(viewer)


def click(viewer, owner, label, inside=8):
    x, y = middle(viewer, owner, label, inside=inside)
    act(viewer, "mousemove", "--sync", x, y, "click", 1)


def shown(viewer):
    """What a renderer without a window makes of the lights in the list that are on."""
    session = viewer.session
    scene = replace(cornell(), camera=session.camera, lights=session.lights.shining)
    return rendered(scene, session.size, set=FEW)


def test_lights_are_added_switched_off_duplicated_and_removed_by_the_mouse(tall):
    viewer, lights, part = tall, tall.session.lights, tall.panel.lights
    alone = picture(viewer)
    click(viewer, part, "##add")
    click(viewer, part, "point")
    viewer.controls.switches["outlines"] = False
    frames(viewer, 2)
    assert [entry.light.kind for entry in lights.entries] == ["spotlight", "point"]
    assert lights.selected == 1
    both = picture(viewer)
    assert np.array_equal(both, shown(viewer))
    assert not np.array_equal(both, alone)
    click(viewer, part, "##on")  # the last one's: Spy keeps the last place of a label
    assert [entry.on for entry in lights.entries] == [True, False]
    assert np.array_equal(picture(viewer), alone)
    click(viewer, part, "##on")
    assert np.array_equal(picture(viewer), both)
    click(viewer, part, "1 spotlight")
    assert lights.selected == 0
    click(viewer, part, "duplicate")
    assert [entry.light.kind for entry in lights.entries] == ["spotlight", "point", "spotlight"]
    click(viewer, part, "remove")
    click(viewer, part, "remove")
    assert np.array_equal(picture(viewer), alone)
    click(viewer, part, "remove")
    assert not lights.entries
    assert viewer.session.error == ""
    assert not picture(viewer).any()


@pytest.mark.parametrize("kind", KINDS)
def test_a_light_of_any_kind_has_its_widgets_and_lines(tall, kind):
    viewer, session = tall, tall.session
    viewer.controls.add_light(KINDS[kind])
    with Spy(viewer.panel.lights.fields) as spy:
        frames(viewer, 2)
    assert session.error == ""
    assert not {name: place for name, place in spy.places.items() if place[2] > viewer.window.size[0]}
    assert len(spy.calls) > 2
    with_lines = picture(viewer).astype(int)
    viewer.controls.toggle("outlines")
    viewer.frame()
    drawn = (picture(viewer).astype(int) != with_lines).any(axis=-1)
    outlines = find_outlines(session)
    assert list(outlines) == [ON, SELECTED]
    middles = np.concatenate(list(outlines.values())).mean(axis=1)
    points, front = project(middles, session)
    inside = front & (points > 2).all(axis=1) & (points < np.array(session.size) - 3).all(axis=1)
    inside &= ~find_hidden(middles, session)
    assert inside.any()
    for x, y in points[inside].astype(int):
        assert drawn[y - 2 : y + 3, x - 2 : x + 3].any()


def test_a_field_is_dragged_and_an_edit_that_cannot_be_is_told(tall):
    viewer, session = tall, tall.session
    session.lights.add(Spot((0.3, 0.5, 0.0), (0.3, 0.0, 0.0), 60.0, 50.0))
    fields = viewer.panel.lights.fields
    x, y = middle(viewer, fields, "inner FOV")
    act(viewer, "mousemove", "--sync", x, y, "keydown", "ctrl", "click", 1, "keyup", "ctrl")
    act(viewer, "key", "ctrl+a", frames=2)
    act(viewer, "type", "70")
    act(viewer, "key", "Return")
    assert session.light.inner_fov == 50.0
    with Spy(viewer.panel) as spy:
        viewer.frame()
    assert any("Spot.inner_fov: must not be more than fov" in word for _, word in spy.calls)
    before = session.light.position
    x, y = middle(viewer, fields, "position", inside=20)
    act(viewer, "mousemove", "--sync", x, y, "mousedown", 1)
    act(viewer, "mousemove", "--sync", x + 30, y)
    act(viewer, "mouseup", 1)
    assert session.light.position[0] > before[0]
    assert session.light.position[1:] == pytest.approx(before[1:])
    assert session.lights.error == ""
    strength = max(session.light.intensity)
    x, y = middle(viewer, fields, "intensity")
    act(viewer, "mousemove", "--sync", x, y, "mousedown", 1)
    act(viewer, "mousemove", "--sync", x - 60, y)
    act(viewer, "mouseup", 1)
    assert session.light.intensity != (strength,) * 3


def test_keys_act_on_the_selected_light(viewer):
    session, lights = viewer.session, viewer.session.lights
    lights.add(BLUE)
    frames(viewer, 2)
    assert np.array_equal(picture(viewer), shown(viewer))
    act(viewer, "keydown", "Right")
    act(viewer, "keyup", "Right")
    step = session.camera.axes @ np.subtract(session.light.position, BLUE.position)
    assert step[0] > 0
    assert lights.entries[0].light == cornell().spotlight
    act(viewer, "key", "v")
    assert not session.from_light, "a point looks nowhere"
    act(viewer, "key", "o")
    assert lights.shining == (cornell().spotlight,)
    act(viewer, "key", "n")
    assert lights.selected == 0
    act(viewer, "key", "v")
    assert session.sees_from_light
    act(viewer, "key", "n")
    assert session.eye == session.camera
    assert session.error == ""


def test_all_lights_are_saved_and_their_ways_play(viewer, tmp_path, monkeypatch):
    from deferred_ir.viewer.edits import recording

    monkeypatch.setattr(panels, "FOLDER", tmp_path)
    monkeypatch.setattr(recording, "PERIOD", 0.0)
    session, lights = viewer.session, viewer.session.lights
    lights.add(BLUE)
    lights.add(replace(BLUE, position=(0.4, 0.2, -0.1)))
    lights.switch(2)
    lights.select(1)
    session.switch_recording(True)
    for _ in range(3):
        viewer.frame()
        lights.edit(lambda light: light.translate((0.05, 0.0, 0.0)))
    viewer.frame()
    session.switch_recording(False)
    frames(viewer, 2)
    assert [bool(light.motion) for light in session.scene.lights] == [False, True, False]
    assert lights.shining == (cornell().spotlight, BLUE)
    before = picture(viewer)
    act(viewer, "key", "ctrl+s")
    saved = load(tmp_path / "cornell-1.toml")
    assert [light.kind for light in saved.lights] == ["spotlight", "point"]
    assert saved.lights[1].motion == session.scene.lights[1].motion
    assert (
        main.main(["render", str(tmp_path / "cornell-1.toml"), "--device", "software", "-o", str(tmp_path / "a.png")])
        == 0
    )
    with Image.open(tmp_path / "a.png") as again:
        assert np.array_equal(np.asarray(again), before)
    session.playing = True
    frames(viewer, 3)
    assert lights.light.position != BLUE.position
    assert [entry.on for entry in lights.entries] == [True, True, False]


def test_a_picture_with_all_lights_off_is_saved_black(viewer, tmp_path, monkeypatch):
    monkeypatch.setattr(panels, "FOLDER", tmp_path)
    act(viewer, "key", "o")
    act(viewer, "key", "ctrl+s")
    assert not picture(viewer).any()
    saved = load(tmp_path / "cornell-1.toml")
    assert not saved.chosen
    assert not rendered(saved, SIZE, set=FEW).any()


def test_an_image_of_the_sky_is_saved_with_its_place(viewer, tmp_path, monkeypatch):
    monkeypatch.setattr(panels, "FOLDER", tmp_path / "there")
    (tmp_path / "there").mkdir()
    Image.new("RGB", (8, 4), (40, 80, 160)).save(tmp_path / "sky.png")
    monkeypatch.chdir(tmp_path)
    viewer.session.lights.add(KINDS["environment"]("sky.png"))
    frames(viewer, 2)
    act(viewer, "key", "ctrl+s")
    assert load(tmp_path / "there" / "cornell-1.toml").lights[1] == viewer.session.light


def test_a_motion_that_cannot_be_followed_stops_and_tells(viewer):
    at, look_at = (0.3, 0.5, 0.0), (0.3, 0.0, 0.0)
    path = KeyframedLight((0.0, 0.1), (at, at), (look_at, at))
    viewer.session.use(replace(cornell(), lights=(Spot(at, look_at, motion=path),)))
    viewer.frame()
    viewer.session.playing = True
    frames(viewer, 6)
    assert not viewer.session.playing
    assert "look_at" in viewer.session.error
    assert viewer.session.light.position == at


def test_every_map_of_a_light_can_be_shown_whichever_pass_draws_it(viewer):
    """A point has six; the atlas and maps of their own hold the same depths."""
    session, maps = viewer.session, {}
    session.lights.add(BLUE)
    for graph in ("forward", "deferred"):
        session.change(graph, FEW)
        viewer.frame()
        with viewer.window:
            maps[graph] = [read(one) for one in viewer.panel.maps._find_maps() if not one.light.startswith("vpl")]
    assert len(maps["deferred"]) == 7
    assert sum(depth.any() for depth in maps["forward"]) >= 6, "only the way out of the box is empty"
    for own, tile in zip(maps["forward"], maps["deferred"], strict=True):
        np.testing.assert_allclose(tile, own, atol=1e-6)


def read(one):
    """The depths of a map, top row last."""
    depth = one.texture.read()
    if one.area is None:
        return depth[..., 0]
    x, y, width, height = one.area.x, one.area.y, one.area.width, one.area.height
    return depth[one.layer, y : y + height, x : x + width, 0]
