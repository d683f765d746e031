"""The viewer's panel: passes, maps, words that fit, motions, and graphs that are saved."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from PIL import Image
from virtual_display import FEW, SIZE, Spy, act, arrange, cornell, frames, middle, picture, rendered, xdo

from deferred_ir.cli import main
from deferred_ir.frame.frame import NEAR
from deferred_ir.frame.light_culling import find_shining
from deferred_ir.graph.file import graph_hash, load_graph
from deferred_ir.loading.load import load
from deferred_ir.viewer.panels import reference
from deferred_ir.viewer.panels import side_panel as panels
from deferred_ir.viewer.panels.light_axes import find_records
from deferred_ir.viewer.panels.side_panel import WIDTH

PARTS = ("Scene", "Lights", "Passes", "Parameters", "Reference", "Shadow map", "Save", "Keys")
TALL = 900
"""Height of a window in which all of the panel's rows show, beside a picture that is NARROW."""
NARROW = 32


@pytest.fixture
def tall(viewer):
    viewer.window.resize((NARROW + WIDTH, TALL))
    frames(viewer, 2)
    yield viewer
    arrange(viewer)


def words(viewer, owner):
    with Spy(owner) as spy:
        viewer.frame()
    return spy.calls


def encoded(linear):
    return 255 * np.clip(np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055), 0, 1)


def test_hovering_an_output_shows_it_and_a_click_pins_it(tall):
    viewer, passes = tall, tall.panel.passes
    whole = picture(viewer)
    with viewer.window:
        albedo = encoded(viewer.session.output(("gbuffer", "albedo")).read()[::-1, ..., :3])
    x, y = middle(viewer, passes, "  albedo")
    act(viewer, "mousemove", "--sync", x, y, frames=2)
    assert passes.shown == ("gbuffer", "albedo")
    assert np.abs(picture(viewer) - albedo).max() <= 1
    act(viewer, "mousemove", "--sync", 20, 20, frames=2)
    assert np.array_equal(picture(viewer), whole)
    act(viewer, "mousemove", "--sync", x, y, "click", 1)
    act(viewer, "mousemove", "--sync", 20, 20, frames=2)
    assert np.abs(picture(viewer) - albedo).max() <= 1
    act(viewer, "mousemove", "--sync", x, y, "click", 1)
    act(viewer, "mousemove", "--sync", 20, 20, frames=2)
    assert passes.pinned is None
    assert np.array_equal(picture(viewer), whole)


def test_what_is_left_out_is_dim_with_its_reason_and_what_it_saves(viewer):
    viewer.session.shine(replace(viewer.session.light, emission=(0.0, 0.0, 0.0)))
    viewer.frame()
    told = [word for name, word in words(viewer, viewer.panel.passes) if name == "text_disabled"]
    maps = next(word for word in told if word.startswith("shadow_maps"))
    assert "no light needs one: nothing shines; that saves about" in maps
    assert maps.endswith(" ms")


def test_skipped_passes_are_marked(viewer):
    frames(viewer, 2)
    viewer.session.look(replace(viewer.session.camera, fov=50.0))
    viewer.frame()
    told = [word for _, word in words(viewer, viewer.panel.passes)]
    assert "shadow_maps: skipped" in told
    assert "gbuffer" in told
    viewer.session.adjust("tonemap.exposure", 1.0)
    viewer.frame()
    assert {"gbuffer: skipped", "lighting: skipped", "tonemap"} <= {
        word for _, word in words(viewer, viewer.panel.passes)
    }


@pytest.mark.parametrize(
    ("graph", "settings"),
    [
        ("deferred", {}),
        ("forward", {}),
        ("incremental", {"direct_rays.visibility": "maps"}),
        ("hemisphere", {}),
        ("forward", {"shadow_maps.projection": "paraboloid"}),
    ],
)
def test_the_map_of_any_light_stands_in_the_corner(viewer, graph, settings):
    viewer.session.change(graph, {**FEW, **settings})
    viewer.controls.switches["map"] = True
    maps, edge = viewer.panel.maps, round(0.33 * SIZE[1])
    viewer.frame()
    vpls = find_records(viewer.session, "vpl")
    tiles = [-1, *sorted(vpls["tile"][find_shining(vpls)].astype(int).tolist())]  # the spotlight's map comes first
    assert len(tiles) > 4
    for maps.light, maps.linear in product((0, 2, len(tiles) - 1), (True, False)):
        viewer.frame()
        depth = depths(viewer, tiles[maps.light])
        texels = (np.arange(edge) * len(depth)) // edge
        near = depth[np.ix_(texels, texels)] / NEAR
        shown = np.divide(1.0, near, out=np.zeros_like(near), where=near > 0) if maps.linear else 0.03 * near
        corner = picture(viewer)[::-1][:edge, :edge, 0]
        assert np.abs(corner - 255 * shown.clip(0, 1)).max() <= 1
        assert corner.any()
    maps.light, maps.linear = 0, True


def depths(viewer, tile):
    """The map of a light, whichever graph drew it: tile -1 is the spotlight's."""
    session = viewer.session
    with viewer.window:
        if session.graph == "forward":
            port, number = ("light_maps", 0) if tile < 0 else ("vpl_maps", tile)
            return session.output(("shadow_maps", port))[number].read()[..., 0]
        atlas, size = session.output(("shadow_maps", "atlas")).read()[..., 0], 256
        if tile < 0:
            return atlas[0]
        layer, place = divmod(tile, (atlas.shape[1] // size) ** 2)
        y, x = divmod(place, atlas.shape[1] // size)
        return atlas[1 + layer, y * size : (y + 1) * size, x * size : (x + 1) * size]


def test_no_word_of_the_panel_is_clipped(tall):
    """With all parts open, in the graph with the most parameters."""
    viewer = tall
    viewer.session.choose("mapped")
    viewer.session.adjust("vpl.count", 4)
    viewer.controls.switches["map"] = True
    arrange(viewer, *PARTS)
    panel, known, right = viewer.panel, {}, viewer.window.size[0]
    for part in (panel, panel.lights, panel.lights.fields, panel.passes, panel.maps, panel.reference):
        with Spy(part) as spy:
            viewer.frame()
        known |= spy.places
    assert {"scene", "camera FOV", "remove", "FOV", "clamp", "paths a pixel", "linear depth"} <= known.keys()
    assert not {name: place for name, place in known.items() if place[2] > right}


def test_a_graph_of_ones_own_is_saved_whole(viewer, tmp_path, monkeypatch):
    monkeypatch.setattr(panels, "FOLDER", tmp_path)
    own = tmp_path / "own" / "mine.toml"
    own.parent.mkdir()
    own.write_text('extends = "interleaved"\n[passes.interleave]\nn = 2\n[passes.tonemap]\noperator = "aces"\n')
    viewer.session.change(str(own), FEW)
    viewer.session.adjust("neighbours.angle", 12.0)
    viewer.frame()
    act(viewer, "key", "ctrl+s")
    assert viewer.session.error == ""
    saved = load_graph(tmp_path / "cornell-1-graph.toml")
    assert graph_hash(saved) == graph_hash(viewer.session.renderer.graph())
    own.unlink()
    again = ["render", str(tmp_path / "cornell-1.toml"), "--device", "software", "-o", str(tmp_path / "again.png")]
    assert main.main(again) == 0
    with Image.open(tmp_path / "cornell-1.png") as one, Image.open(tmp_path / "again.png") as other:
        assert np.array_equal(np.asarray(one), np.asarray(other))
    act(viewer, "key", "ctrl+s")
    assert (tmp_path / "cornell-2-graph.toml").exists()


@pytest.fixture
def moving(tmp_path):
    """A scene file in whose middle a box moves."""
    first = cornell()
    (tmp_path / "box.obj").write_text(
        "v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nv 0 0 0.1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n", encoding="utf-8"
    )
    scene = tmp_path / "moving.toml"
    scene.write_text(
        f'[[model]]\npath = "{first.path.parent / "cornell.obj"}"\n[[model]]\npath = "box.obj"\n'
        "[model.motion]\ntimes = [0, 1]\ntranslations = [[0.1, 0.1, 0.3], [0.4, 0.3, 0.3]]\n"
        "rotations = [[0, 0, 0, 1], [0, 0.38, 0, 0.92]]\n"
        f"[camera]\nposition = {list(first.camera.position)}\nlook_at = {list(first.camera.look_at)}\n"
        f"[spotlight]\nposition = {list(first.spotlight.position)}\nlook_at = {list(first.spotlight.look_at)}\n"
        f"emission = {list(first.spotlight.emission)}\n"
    )
    return scene


def test_models_that_move_play_and_are_saved_where_they_are(viewer, moving, tmp_path, monkeypatch):
    monkeypatch.setattr(panels, "FOLDER", tmp_path)
    session = viewer.session
    session.open(str(moving))
    session.change("deferred", FEW)
    viewer.frame()
    before = picture(viewer)
    assert np.array_equal(before, rendered(load(moving), set=FEW))
    assert "play motions (P)" in [word for _, word in words(viewer, viewer.panel)]
    act(viewer, "key", "p", frames=1)
    while session.time < 0.2:
        viewer.frame()
    assert session.playing
    act(viewer, "key", "p", frames=2)
    viewer.frame()
    assert not session.playing
    assert np.array_equal(picture(viewer), rendered(load(moving), set=FEW, time=session.time))
    assert not np.array_equal(picture(viewer), before)
    act(viewer, "key", "ctrl+s")
    saved = tmp_path / f"{session.scene.name}-1.toml"
    assert main.main(["render", str(saved), "--device", "software", "-o", str(tmp_path / "again.png")]) == 0
    with Image.open(saved.with_suffix(".png")) as one, Image.open(tmp_path / "again.png") as other:
        assert np.array_equal(np.asarray(one), np.asarray(other))


def test_a_camera_path_is_recorded_by_the_checkbox_played_and_saved(viewer, tmp_path, monkeypatch):
    from deferred_ir.viewer.edits import recording

    monkeypatch.setattr(panels, "FOLDER", tmp_path)
    monkeypatch.setattr(recording, "PERIOD", 0.0)
    session, start = viewer.session, viewer.session.camera
    session.switch_recording(True)
    viewer.frame()
    act(viewer, "keydown", "w")
    act(viewer, "keyup", "w")
    end = session.camera
    session.switch_recording(False)
    assert session.camera == start
    assert session.scene.spotlight.motion is None
    act(viewer, "key", "ctrl+s")
    saved = load(tmp_path / "cornell-1.toml")
    assert saved.camera.motion == session.scene.camera.motion is not None
    assert np.allclose(saved.at(saved.camera.motion.times[-1]).camera.position, end.position)
    act(viewer, "key", "p", frames=2)
    assert session.camera != start
    assert np.array_equal(picture(viewer), rendered(replace(saved, camera=session.camera), set=FEW))


def test_frames_of_incremental_go_on_until_they_come_to_rest(viewer):
    viewer.session.choose("incremental")
    viewer.session.adjust("vpl.count", 16)
    drawn = 0
    while viewer.frame() and drawn < 50:
        drawn += 1
    assert 1 < drawn < 50
    assert not viewer.frame()


def click(viewer, label, owner=None):
    x, y = middle(viewer, owner or viewer.panel, label, inside=8)
    act(viewer, "mousemove", "--sync", x, y, "click", 1)


def test_parameters_are_set_by_the_mouse(tall):
    """Those of any pass, made of their declarations: a slider, a choice, a number that can be automatic."""
    viewer, session = tall, tall.session
    arrange(viewer, "Scene", "Parameters")
    x, y = middle(viewer, viewer.panel, "count")
    act(viewer, "mousemove", "--sync", x, y, "mousedown", 1)
    act(viewer, "mousemove", "--sync", x + 60, y)
    act(viewer, "mouseup", 1)
    vpl = session.renderer.graph().nodes["vpl"].work.params
    assert vpl.count > 8
    click(viewer, "auto##clamp")
    x, y = middle(viewer, viewer.panel, "pattern")
    act(viewer, "mousemove", "--sync", x, y, "click", 1)
    act(viewer, "mousemove", "--sync", x, y + 25, "click", 1)  # the first of the list, which opens below
    changed = session.renderer.graph().nodes["vpl"].work.params
    assert (vpl.clamp, vpl.pattern) != ("auto", "random")
    assert (changed.clamp, changed.pattern) == ("auto", "random")
    session.adjust("vpl.count", 8)
    viewer.frame()
    assert np.array_equal(picture(viewer), rendered(cornell(), session.size, set=dict(session.settings)))


def test_scene_and_graph_are_chosen_from_lists(tall):
    viewer = tall
    click(viewer, "graph")
    click(viewer, "interleaved")
    assert viewer.session.graph == "interleaved"
    click(viewer, "scene")
    click(viewer, "colors")
    assert viewer.session.scene.name == "colors"
    assert viewer.session.error == ""


def test_a_reference_is_asked_for_by_a_button(tall, monkeypatch):
    viewer, truth = tall, tall.panel.reference
    monkeypatch.setattr(reference, "SPP", (1, 2))
    truth._spp = 0
    click(viewer, "Passes")
    click(viewer, "Reference")
    told = []
    click(viewer, "compare with reference", truth)
    while truth.job.running:
        told += [name for name, _ in words(viewer, truth)]
    viewer.frame()
    assert truth.job.result is not None
    assert "progress_bar" in told or truth.job.progress == 1.0


def test_a_number_is_typed_into_a_slider(tall):
    """By Ctrl and click."""
    viewer = tall
    x, y = middle(viewer, viewer.panel.lights.fields, "FOV")
    act(viewer, "mousemove", "--sync", x, y, "keydown", "ctrl", "click", 1, "keyup", "ctrl")
    xdo("key", "ctrl+a")
    act(viewer, "type", "60")
    act(viewer, "key", "Return")
    assert viewer.session.light.fov == pytest.approx(60.0)
    assert viewer.session.camera == cornell().camera, "keys in a field fly nothing"
