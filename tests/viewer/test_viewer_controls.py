"""Light, parameters, passes and files that change on disk, in a real window."""

from __future__ import annotations

import shutil
from dataclasses import replace

import numpy as np
import pytest
from virtual_display import FEW, SIZE, Spy, act, cornell, frames, middle, picture, rendered, xdo

from deferred_ir.viewer.panels import light_axes, lines


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
    before = viewer.session.light
    act(viewer, "keydown", "Right")
    act(viewer, "keyup", "Right")
    light = viewer.session.light
    step = viewer.session.camera.axes @ np.subtract(light.position, before.position)
    assert step[0] > 0
    assert np.allclose(step[1:], 0)
    assert np.allclose(light.axis, before.axis)
    assert np.array_equal(picture(viewer), rendered(replace(cornell(), lights=(light,)), set=FEW))


def test_the_right_button_moves_the_light(viewer):
    before = viewer.session.light
    act(viewer, "mousemove", 40, 40)
    act(viewer, "mousedown", 3)
    act(viewer, "mousemove", 60, 40)
    act(viewer, "mouseup", 3)
    step = viewer.session.camera.axes @ np.subtract(viewer.session.light.position, before.position)
    assert step[0] > 0
    assert np.allclose(step[1:], 0)


def test_the_light_is_put_at_the_camera_and_seen_from(viewer):
    act(viewer, "key", "l")
    session = viewer.session
    assert session.light.position == session.camera.position
    assert session.light.look_at == session.camera.look_at
    act(viewer, "key", "v")
    assert session.from_light
    assert session.eye.fov == session.light.fov
    shown = replace(cornell(), camera=session.eye, lights=(session.light,))
    assert np.array_equal(picture(viewer), rendered(shown, set=FEW))


def test_axes_are_drawn_where_the_lights_are(viewer):
    before = picture(viewer).astype(int)
    act(viewer, "key", "f")
    origins, _ = light_axes.find_bases(viewer.session)
    blue = picture(viewer).astype(int) - before
    drawn = (blue != 0).any(axis=-1)
    assert drawn.any()
    points, front = lines.project(origins, viewer.session)
    inside = front & (points > 1).all(axis=1) & (points < np.array(SIZE) - 2).all(axis=1)
    assert inside.sum() >= 4
    for x, y in points[inside].astype(int):
        assert drawn[y - 1 : y + 2, x - 1 : x + 2].any()


def test_a_projected_point_is_where_the_ray_of_its_pixel_goes(viewer):
    rays = viewer.session.eye.rays(viewer.session.size)
    points, front = lines.project(np.asarray(viewer.session.eye.position) + rays[7, 11][None], viewer.session)
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
    light = viewer.session.light
    viewer.session.shine(replace(light, emission=(0.0, 0.0, 0.0)))
    viewer.frame()
    assert "shadow_maps" in viewer.session.plan.left_out
    viewer.session.shine(light)
    viewer.frame()
    assert np.array_equal(picture(viewer), rendered(cornell(), set=FEW))


def test_space_averages_frames_and_a_move_starts_again(viewer):
    act(viewer, "key", "space", frames=0)
    while not viewer.session.accumulation or viewer.session.accumulation.frames < 3:
        viewer.frame()
    with Spy(viewer.panel) as spy:
        viewer.frame()
    assert any("frames, relMSE by noise" in word for _, word in spy.calls)
    assert np.array_equal(picture(viewer), rendered(cornell(), set=FEW, accumulate=4))
    viewer.session.adjust("tonemap.operator", "none")
    viewer.frame()
    assert viewer.session.accumulation.frames == 4, "what comes after the mean changes without starting again"
    viewer.session.look(replace(viewer.session.camera, fov=50.0))
    viewer.frame()
    assert viewer.session.accumulation is None


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
    before = viewer.session.light
    x, y = middle(viewer, viewer.panel.lights.fields, "FOV")
    xdo("mousemove", x, y)
    frames(viewer)
    act(viewer, "mousedown", 1)
    act(viewer, "mousemove", x - 40, y)
    act(viewer, "mouseup", 1)
    assert viewer.session.light.fov < before.fov
