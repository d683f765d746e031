"""The list of lights without a window: what is added, removed, switched off, edited, recorded; all by the class."""

from __future__ import annotations

from dataclasses import fields, replace
from types import SimpleNamespace

import numpy as np
import pytest
from virtual_display import cornell

from deferred_ir.scene.camera import Camera
from deferred_ir.scene.environment_image import EnvironmentImage
from deferred_ir.scene.lights.environment import Environment
from deferred_ir.scene.lights.kinds import find_kinds
from deferred_ir.scene.lights.point import Point
from deferred_ir.scene.lights.rect import Rect
from deferred_ir.scene.lights.spot import Spot
from deferred_ir.scene.lights.spotlight import Spotlight
from deferred_ir.scene.motion import KeyframedLight, LissajousMotion
from deferred_ir.viewer.edits.lights import LightList, make_light, set_field
from deferred_ir.viewer.edits.recording import Recorder
from deferred_ir.viewer.navigation import as_camera, as_light, looks, turn_light
from deferred_ir.viewer.panels.light_fields import name_field, split_strength
from deferred_ir.viewer.saving import describe_lights

KINDS = find_kinds()
WAY = 0.8
SPOT, POINT = Spot((0.0, 1.0, 0.0), (0.0, 0.0, 0.0)), Point((1.0, 0.0, 0.0), (2.0, 3.0, 4.0))


@pytest.fixture
def lights():
    made = LightList(lambda: None)
    made.use((SPOT, POINT))
    return made


def irradiance(light, at):
    """Mean luminance that a light brings to a point, by its own samples."""
    places = np.random.default_rng(1).random((4096, 2)) if light.has_area else None
    if places is not None:
        radius, angle = np.sqrt(places[:, 0]), 2 * np.pi * places[:, 1]
        places = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)
    found = light.sample(np.tile(at, (1 if places is None else len(places), 1)), places, cornell().bounds)
    strength = np.broadcast_to(found.strength.T, (3, len(found.strength))).T
    return float((strength * light.emission).mean(axis=0) @ [0.2126, 0.7152, 0.0722])


@pytest.mark.parametrize("kind", KINDS)
def test_a_new_light_of_any_kind_shines_on_what_the_camera_sees(kind):
    scene = cornell()
    camera = scene.camera
    target = np.asarray(camera.position) + WAY * camera.axes[2]
    made = make_light(KINDS[kind], camera, WAY, (), scene.bounds)
    assert irradiance(made, target) == pytest.approx(1.0, rel=0.05)
    beside = make_light(KINDS[kind], camera, WAY, (made, made), scene.bounds)
    assert irradiance(beside, target) == pytest.approx(2.0, rel=0.05), "as bright as the others"
    if hasattr(made, "position"):
        ahead = camera.axes @ np.subtract(made.position, camera.position)
        assert 0 < ahead[2] < WAY
        assert abs(ahead[0]) < 1e-9
        assert 0 < ahead[1] < 0.5 * ahead[2]


def test_a_new_rectangle_can_be_made_from_any_view():
    for look_at in ((0.0, -5.0, 0.0), (0.0, 5.0, 0.1)):
        made = make_light(Rect, Camera((0.0, 0.0, 0.0), look_at, (0.0, 0.0, 1.0)), 1.0, (), cornell().bounds)
        assert made.up == (0.0, 0.0, 1.0)


def test_lights_are_added_selected_and_removed(lights):
    assert (lights.light, lights.shining) == (SPOT, (SPOT, POINT))
    lights.add(POINT)
    assert (lights.selected, lights.shining) == (2, (SPOT, POINT, POINT))
    lights.select_next()
    lights.remove()
    assert (lights.light, lights.shining) == (POINT, (POINT, POINT))
    lights.select(1)
    lights.duplicate((0.0, 1.0, 0.0))
    assert lights.light == replace(POINT, position=(1.0, 1.0, 0.0))
    for _ in range(4):
        lights.remove()
    assert (lights.light, lights.shining) == (None, ())
    lights.duplicate((0.0, 1.0, 0.0))
    lights.edit(lambda light: light)
    lights.select_next()
    assert not lights.entries
    lights.put(SPOT)
    assert lights.shining == (SPOT,)


def test_a_light_that_is_off_keeps_its_strength_and_can_be_edited(lights):
    lights.select(1)
    lights.switch(1)
    assert lights.shining == (SPOT,)
    lights.edit(lambda light: light.translate((0.0, 0.0, 1.0)))
    assert lights.shining == (SPOT,)
    lights.switch(1)
    assert lights.shining == (SPOT, replace(POINT, position=(1.0, 0.0, 1.0)))


@pytest.mark.parametrize(
    ("name", "value"),
    [("inner_fov", 170.0), ("look_at", SPOT.position), ("fov", float("nan")), ("intensity", (-1, 0, 0))],
)
def test_an_edit_that_cannot_be_is_told_and_changes_nothing(lights, name, value):
    lights.edit(lambda light: set_field(light, name, value))
    assert f"Spot.{name}: " in lights.error
    assert lights.light == SPOT
    lights.edit(lambda light: set_field(light, "fov", 100.0))
    assert (lights.error, lights.light.fov) == ("", 100.0)


def test_an_image_and_a_constant_take_each_others_place(lights, tmp_path):
    image = EnvironmentImage(np.ones((2, 4, 3)))
    lights.add(Environment(radiance=(1.0, 1.0, 1.0), scale=3.0))
    lights.edit(lambda light: set_field(light, "image", image))
    assert lights.light == Environment(image, scale=3.0)
    lights.edit(lambda light: set_field(light, "image", tmp_path / "gone.hdr"))
    assert "gone.hdr" in lights.error
    assert lights.light.image is image
    lights.edit(lambda light: set_field(light, "radiance", (0.5, 0.5, 0.5)))
    assert lights.light == Environment(radiance=(0.5, 0.5, 0.5), scale=3.0)


@pytest.mark.parametrize("kind", KINDS)
def test_lights_of_any_kind_are_moved_turned_and_put_at_the_camera(kind):
    scene = cornell()
    light = make_light(KINDS[kind], scene.camera, WAY, (), scene.bounds)
    turned, put = turn_light(light, 0.3, 0.1), as_light(light, scene.camera)
    for changed in (turned, put):
        places = ("position", "look_at", "rotation")
        other = {one.name for one in fields(light) if getattr(changed, one.name) != getattr(light, one.name)}
        assert other <= set(places)
    if looks(light):
        assert turned.position == light.position
        assert turned.axis @ scene.camera.axes[0] > 0.2
        eye = as_camera(put, scene.camera.fov)
        assert (eye.position, eye.look_at) == (scene.camera.position, scene.camera.look_at)
        assert eye.fov == getattr(light, "fov", scene.camera.fov)


def test_an_environment_turns_as_the_camera_would():
    """To the right: its middle, at -z, goes to +x."""
    image = np.zeros((8, 16, 3))
    image[3:5, 7:9] = 1.0
    light = turn_light(Environment(EnvironmentImage(image)), np.pi / 2, 0.0)
    np.testing.assert_allclose(light.look_up(np.array([[1.0, 0.0, 0.0]])), 1.0)
    assert turn_light(light, np.pi, 0.0).rotation == pytest.approx(90.0)


def test_a_strength_is_apart_from_its_colour():
    assert split_strength((0.5, 1.0, 2.0), (1.0, 1.0, 1.0)) == ((0.25, 0.5, 1.0), 2.0)
    assert split_strength((0.0, 0.0, 0.0), (0.0, 3.0, 6.0)) == ((0.0, 0.5, 1.0), 0.0)
    assert split_strength((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)) == ((1.0, 1.0, 1.0), 0.0)
    assert [name_field(name) for name in ("inner_fov", "look_at")] == ["inner FOV", "look at"]


def test_lights_with_a_motion_follow_it_and_keep_their_edits(lights):
    moving = replace(SPOT, motion=LissajousMotion((0.5, 0.0, 0.0), (1.0, 1.0)))
    lights.use((moving, POINT))
    assert lights.light == replace(SPOT, position=(0.5, 1.0, 0.0))
    lights.edit(lambda light: set_field(light, "fov", 30.0))
    assert lights.entries[0].with_motion == replace(moving, fov=30.0)
    lights.follow(np.pi / 2)
    assert lights.light.fov == 30.0
    np.testing.assert_allclose(lights.light.position, (0.0, 1.0, 0.0), atol=1e-12)
    assert lights.entries[0].with_motion == lights.light, "elsewhere it rests"
    assert lights.entries[1].with_motion == POINT


def test_each_light_that_moves_is_recorded(lights):
    lights.add(Environment(radiance=(1.0, 1.0, 1.0)))
    recorder, camera = Recorder(), cornell().camera
    for step in range(4):
        lights.select(1)
        lights.edit(lambda light: light.translate((0.0, 1.0, 0.0)))
        if step == 2:
            lights.add(Spotlight((0.0, 0.0, 0.0), (0.0, 0.0, 1.0)))
        if step == 3:
            lights.select(3)
            lights.edit(lambda light: light.translate((2.0, 0.0, 0.0)))
            lights.edit(lambda light: set_field(light, "emission", (5.0, 5.0, 5.0)))
        recorder.add(10.0 + step / 4, camera, lights.entries)
    spot, point, sky, added = (recorder.make_light(entry) for entry in lights.entries)
    assert (spot, sky) == (SPOT, Environment(radiance=(1.0, 1.0, 1.0)))
    times = tuple(step / 4 for step in range(4))
    assert point == replace(
        POINT,
        position=(1.0, 1.0, 0.0),
        motion=KeyframedLight(times, tuple((1.0, 1.0 + step, 0.0) for step in range(4))),
    )
    assert added.motion == KeyframedLight(times[2:], ((0, 0, 0), (2, 0, 0)), ((0, 0, 1), (2, 0, 1)))
    assert added.emission == (5.0, 5.0, 5.0), "edits stay"
    assert recorder.make_camera(camera) == camera
    lights.switch(0)
    lights.restart((spot, point, sky, added))
    assert lights.shining == (point.at(0.0), sky, added.at(0.0))


def test_lights_that_are_off_are_not_saved(lights):
    session = SimpleNamespace(lights=lights, camera=cornell().camera, shown=SimpleNamespace(emits=True))
    lights.switch(0)
    assert describe_lights(session) == (POINT,)
    lights.switch(1)
    assert describe_lights(session) == (), "as surfaces emit"
    session.shown.emits = False
    (black,) = describe_lights(session)
    assert black.emission == (0.0, 0.0, 0.0), "or a loader would choose one"
