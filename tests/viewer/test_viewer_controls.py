"""Light, parameters, passes, reference and saving in the viewer, in a real window."""

from __future__ import annotations

import shutil
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image
from virtual_display import FEW, SIZE, Spy, act, cornell, frames, middle, picture, rendered, xdo

from deferred_ir.cli import main
from deferred_ir.loading.load import load
from deferred_ir.output.exposure import automatic_stops
from deferred_ir.viewer import saving
from deferred_ir.viewer.panels import light_axes
from deferred_ir.viewer.panels import side_panel as panels
from deferred_ir.viewer.tone_map import tone_map


def test_a_parameter_rebuilds_nothing_and_runs_only_what_reads_it(viewer):
    session = viewer.session
    executor = session.renderer.executor
    viewer.frame()
    session.adjust("tonemap.exposure", 1.0)
    viewer.frame()
    resources, compiled = dict(executor.allocation._resources), executor.library.compiled
    session.laps.clear()
    for stops in (1.5, 2.0, -3.0):
        session.adjust("tonemap.exposure", stops)
        viewer.frame()
    assert dict(executor.allocation._resources) == resources
    assert executor.library.compiled == compiled
    assert set(session.laps) == {"tonemap"}
    assert np.array_equal(picture(viewer), rendered(cornell(), set={**FEW, "tonemap.exposure": -3.0}))


def test_nothing_runs_where_nothing_changes(viewer):
    viewer.frame()
    viewer.session.laps.clear()
    assert not viewer.frame()
    assert not viewer.session.laps


@pytest.mark.parametrize("graph", ["forward", "interleaved", "hemisphere"])
def test_every_graph_can_be_chosen(viewer, graph):
    viewer.session.choose(graph)
    viewer.session.adjust("vpl.count", 8)
    viewer.frame()
    assert viewer.session.error == ""
    assert np.array_equal(picture(viewer), rendered(cornell(), graph=graph, set=FEW))


def test_a_setting_that_cannot_be_leaves_the_picture_and_tells(viewer):
    before = picture(viewer)
    viewer.session.adjust("shadow_maps.budget", 1)
    frames(viewer)
    assert "shadow_maps.budget" in viewer.session.error
    assert np.array_equal(picture(viewer), before)
    viewer.session.adjust("tonemap.operator", "none")
    frames(viewer)
    assert viewer.session.error == ""


def test_keys_move_the_light(viewer):
    before = viewer.session.spotlight
    act(viewer, "keydown", "Right")
    act(viewer, "keyup", "Right")
    light = viewer.session.spotlight
    step = viewer.session.camera.axes @ np.subtract(light.position, before.position)
    assert step[0] > 0
    assert np.allclose(step[1:], 0)
    assert np.allclose(light.axis, before.axis)
    assert np.array_equal(picture(viewer), rendered(replace(cornell(), spotlight=light), set=FEW))


def test_the_right_button_moves_the_light(viewer):
    before = viewer.session.spotlight
    act(viewer, "mousemove", 40, 40)
    act(viewer, "mousedown", 3)
    act(viewer, "mousemove", 60, 40)
    act(viewer, "mouseup", 3)
    step = viewer.session.camera.axes @ np.subtract(viewer.session.spotlight.position, before.position)
    assert step[0] > 0
    assert np.allclose(step[1:], 0)


def test_the_light_is_put_at_the_camera_and_seen_from(viewer):
    act(viewer, "key", "l")
    session = viewer.session
    assert session.spotlight.position == session.camera.position
    assert session.spotlight.look_at == session.camera.look_at
    act(viewer, "key", "v")
    assert session.from_light
    assert session.eye.fov == session.spotlight.fov
    shown = replace(cornell(), camera=session.eye, spotlight=session.spotlight)
    assert np.array_equal(picture(viewer), rendered(shown, set=FEW))


def test_axes_are_drawn_where_the_lights_are(viewer):
    before = picture(viewer).astype(int)
    act(viewer, "key", "f")
    origins, _ = light_axes.find_bases(viewer.session)
    blue = picture(viewer).astype(int) - before
    drawn = (blue != 0).any(axis=-1)
    assert drawn.any()
    points, front = light_axes.project(origins, viewer.session)
    inside = front & (points > 1).all(axis=1) & (points < np.array(SIZE) - 2).all(axis=1)
    assert inside.sum() >= 4
    for x, y in points[inside].astype(int):
        assert drawn[y - 1 : y + 2, x - 1 : x + 2].any()


def test_a_projected_point_is_where_the_ray_of_its_pixel_goes(viewer):
    rays = viewer.session.eye.rays(viewer.session.size)
    points, front = light_axes.project(np.asarray(viewer.session.eye.position) + rays[7, 11][None], viewer.session)
    assert front.all()
    assert np.allclose(points, [[11.5, 7.5]])


def test_the_output_of_a_pass_is_shown_while_pinned(viewer):
    viewer.panel.passes.pinned = ("gbuffer", "albedo")
    viewer.frame()
    with viewer.window:
        albedo = viewer.session.output(("gbuffer", "albedo")).read()[::-1, ..., :3]
    encoded = np.where(albedo <= 0.0031308, 12.92 * albedo, 1.055 * albedo ** (1 / 2.4) - 0.055)
    assert np.abs(picture(viewer) - 255 * np.clip(encoded, 0, 1)).max() <= 1
    viewer.panel.passes.pinned = ("shadow_maps", "gone")
    viewer.frame()
    assert np.array_equal(picture(viewer), rendered(cornell(), set=FEW))
    viewer.panel.passes.pinned = None


@pytest.mark.parametrize("graph", ["deferred", "forward", "accurate"])
def test_all_outputs_of_all_passes_can_be_shown(viewer, graph):
    viewer.session.choose(graph)
    viewer.session.adjust("vpl.count", 8)
    viewer.frame()
    for step in viewer.session.plan.steps:
        for port in step.outputs:
            viewer.panel.passes.pinned = (step.name, port)
            viewer.frame()
    viewer.panel.passes.pinned = None
    assert viewer.session.error == ""


def test_a_dark_light_leaves_passes_out_and_back(viewer):
    light = viewer.session.spotlight
    viewer.session.shine(replace(light, emission=(0.0, 0.0, 0.0)))
    viewer.frame()
    assert "shadow_maps" in viewer.session.plan.left_out
    viewer.session.shine(light)
    viewer.frame()
    assert np.array_equal(picture(viewer), rendered(cornell(), set=FEW))


def test_space_averages_frames_and_a_move_starts_again(viewer):
    act(viewer, "key", "space", frames=0)
    while not viewer.session.accumulation or viewer.session.accumulation.frames < 4:
        viewer.frame()
    assert "relMSE" in viewer.session.noise_text
    assert np.array_equal(picture(viewer), rendered(cornell(), set=FEW, accumulate=4))
    viewer.session.adjust("tonemap.operator", "none")
    viewer.frame()
    assert viewer.session.accumulation.frames == 4, "what comes after the mean changes without starting again"
    viewer.session.look(replace(viewer.session.camera, fov=50.0))
    viewer.frame()
    assert viewer.session.accumulation is None


def test_the_reference_is_split_into_the_picture_and_measured(viewer):
    panel = viewer.panel.reference
    panel._spp, panel.at = 0, 0.5
    before = picture(viewer)
    panel.start()
    while panel.job.running:
        viewer.frame(0.02)
    frames(viewer, 2)
    assert panel.job.error == ""
    half = SIZE[0] // 2
    assert np.array_equal(picture(viewer)[:, :half], before[:, :half])
    result, stops = panel.job.result, automatic_stops(viewer.session.image().radiance)
    assert np.array_equal(picture(viewer)[:, half:], tone_map(viewer.session, result.radiance, stops)[::-1, half:, :3])
    with Spy(viewer.panel) as spy:
        viewer.frame()
    assert any(word.startswith("relMSE 0.") for _, word in spy.calls), "in the status line, whatever is open"
    viewer.session.look(replace(viewer.session.camera, fov=50.0))
    frames(viewer, 2)
    assert not panel._matches


def test_both_sides_of_the_split_have_the_exposure_of_the_picture(viewer):
    """A reference four times as bright is shown two stops brighter, though the exposure is automatic."""
    panel, session = viewer.panel.reference, viewer.session
    panel._spp = 0
    panel.start()
    while panel.job.running:
        viewer.frame(0.02)
    radiance = session.image().radiance
    panel.job.result = replace(panel.job.result, radiance=4 * radiance)
    frames(viewer, 2)
    half, stops = SIZE[0] // 2, automatic_stops(radiance)
    expected = rendered(cornell(), set={**FEW, "tonemap.exposure": stops + 2})
    assert np.array_equal(picture(viewer)[:, half:], expected[:, half:])
    same = rendered(cornell(), set={**FEW, "tonemap.exposure": stops}).astype(int)
    assert np.abs(picture(viewer)[:, :half] - same[:, :half]).max() <= 1
    session.adjust("vpl.count", 4)
    frames(viewer, 2)
    stops = automatic_stops(session.image().radiance)
    expected = rendered(cornell(), set={"vpl.count": 8, "tonemap.exposure": automatic_stops(radiance)})
    assert np.array_equal(picture(viewer)[:, half:], tone_map(session, 4 * radiance, stops)[::-1, half:, :3])


def test_a_trace_can_be_given_up(viewer):
    panel = viewer.panel.reference
    panel._spp = 3
    panel.start()
    viewer.frame()
    panel.job.stop()
    assert not panel.job.running
    assert panel.job.result is None
    panel._spp = 1


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
    from deferred_ir.viewer import recording as path

    monkeypatch.setattr(panels, "FOLDER", tmp_path)
    monkeypatch.setattr(path, "PERIOD", 0.0)
    session = viewer.session
    start = session.spotlight
    session.switch_recording(True)
    viewer.frame()
    act(viewer, "keydown", "Right")
    act(viewer, "keyup", "Right")
    session.switch_recording(False)
    act(viewer, "key", "ctrl+s")
    saved = load(tmp_path / "cornell-1.toml")
    assert saved.spotlight.motion == session.scene.spotlight.motion is not None
    assert saved.camera.motion is None
    assert session.spotlight == start
    session.playing = True
    frames(viewer, 3)
    assert session.spotlight != start


def test_shaders_and_graphs_are_read_again_and_a_broken_edit_keeps_the_picture(viewer, tmp_path, monkeypatch):
    from deferred_ir.gl import shaders
    from deferred_ir.viewer import file_watch

    monkeypatch.setattr(file_watch, "PERIOD", 0.0)
    source = shaders.package_shaders()
    folder = tmp_path / "shaders"
    shutil.copytree(source, folder)
    for module in (shaders, file_watch):
        monkeypatch.setattr(module, "package_shaders", lambda: folder)
    graph = tmp_path / "mine.toml"
    graph.write_text('extends = "deferred"\n[passes.vpl]\ncount = 8\n')
    viewer.session.change(str(graph), {})
    monkeypatch.setattr(viewer, "watch", file_watch.FileWatch())
    frames(viewer)
    before = picture(viewer)
    tonemap = folder / "tonemap/tonemap.frag"
    text = tonemap.read_text()
    tonemap.write_text(text.replace("void main() {", "void main() { oops"))
    frames(viewer)
    line = next(i for i, row in enumerate(text.splitlines(), 1) if "void main() {" in row)
    assert (
        f"tonemap/tonemap.frag:{line}" in viewer.session.error
        or f"tonemap/tonemap.frag:{line + 1}" in viewer.session.error
    )
    assert np.array_equal(picture(viewer), before)
    tonemap.write_text(text.rstrip().removesuffix("}") + "    color = color.bgra;\n}\n")
    frames(viewer)
    assert viewer.session.error == ""
    assert np.array_equal(picture(viewer), before[..., ::-1])
    graph.write_text("[passes")
    frames(viewer)
    assert "mine.toml: not a TOML file" in viewer.session.error
    graph.write_text('extends = "deferred"\n[passes.vpl]\ncount = 4\n')
    tonemap.write_text(text)
    frames(viewer)
    assert viewer.session.error == ""
    assert np.array_equal(picture(viewer), rendered(cornell(), set={"vpl.count": 4}))


def test_a_slider_is_dragged_by_the_mouse(viewer):
    viewer.window.resize((SIZE[0] + 380, 700))
    frames(viewer)
    before = viewer.session.spotlight
    x, y = middle(viewer, viewer.panel, "light FOV")
    xdo("mousemove", x, y)
    frames(viewer)
    act(viewer, "mousedown", 1)
    act(viewer, "mousemove", x - 40, y)
    act(viewer, "mouseup", 1)
    assert viewer.session.spotlight.fov < before.fov
