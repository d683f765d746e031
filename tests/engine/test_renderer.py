"""The Renderer over many frames: what is kept, what is made anew, what is measured, and what is refused."""

from __future__ import annotations

import threading
from dataclasses import replace

import numpy as np
import pytest
from small_scenes import build, plane, room, textured

from deferred_ir.base.errors import DeviceError, GraphError, SettingError
from deferred_ir.engine.measurement import Measurement
from deferred_ir.engine.renderer import Renderer
from deferred_ir.gl.context import Gpu
from deferred_ir.gl.timers import DELAY
from deferred_ir.scene.lights.spotlight import Spotlight
from deferred_ir.scene.motion import LissajousMotion

SIZE = (40, 24)


def test_an_image_has_the_asked_size_and_types(renderer):
    image = renderer(SIZE).render(room(), vpls=4)
    assert (image.radiance.shape, image.radiance.dtype) == ((24, 40, 3), np.float32)
    assert (image.display.shape, image.display.dtype) == ((24, 40, 3), np.uint8)
    assert image.radiance.flags.c_contiguous


@pytest.mark.parametrize("size", [(1, 1), (1, 33), (257, 3)])
def test_odd_sizes(renderer, size):
    image = renderer(size).render(room(), vpls=4)
    assert image.radiance.shape == (size[1], size[0], 3)
    assert image.radiance.min() > 0


def test_only_what_is_asked_for_is_made(renderer):
    one = renderer(SIZE)
    plan = one.plan(room(), 4, ["radiance"])
    assert plan.left_out.keys() == {"tonemap", "light_points", "environment", "gbuffer.emission", "gbuffer.material"}
    assert plan.left_out["tonemap"] == "no requested output needs it"
    one.draw(room(), plan)
    image = one.read(plan)
    assert image.display is None
    assert image.radiance.max() > 0


# What is kept


def test_a_renderer_goes_from_scene_to_scene_and_back(renderer):
    one, first, second = renderer(SIZE), room(), build(plane())
    before = one.render(first, vpls=8).radiance
    other = one.render(second, vpls=8).radiance
    np.testing.assert_array_equal(one.render(first, vpls=8).radiance, before)
    np.testing.assert_array_equal(renderer(SIZE).render(second, vpls=8).radiance, other)


def test_the_same_geometry_is_uploaded_once(renderer):
    one, scene = renderer(SIZE), room()
    one.render(scene, vpls=4)
    buffers, tracer = one._buffers, one.tracer()
    moved = replace(scene, camera=replace(scene.camera, fov=30.0), lights=(replace(scene.spotlight, fov=20.0),))
    assert not np.array_equal(one.render(moved, vpls=4).radiance, one.render(scene, vpls=4).radiance)
    assert one._buffers is buffers
    assert one.tracer() is tracer


def test_new_materials_on_the_same_geometry_show(renderer):
    scene = room()
    red = replace(scene, materials=tuple(replace(material, base_color=(0.8, 0.0, 0.0)) for material in scene.materials))
    one = renderer(SIZE)
    one.render(scene, vpls=8)
    np.testing.assert_array_equal(one.render(red, vpls=8).radiance, renderer(SIZE).render(red, vpls=8).radiance)


def test_new_textures_on_the_same_geometry_show(renderer):
    uvs = [[0, 0], [1, 0], [1, 1], [0, 1]]
    scene = textured(build(plane()), np.full((2, 2, 3), 200), uvs)
    dark = replace(scene, textures=(replace(scene.textures[0], pixels=np.full((2, 2, 3), 20, np.uint8)),))
    one = renderer(SIZE)
    bright = one.render(scene, vpls=4).radiance
    assert one.render(dark, vpls=4).radiance.max() < 0.1 * bright.max()


def test_resources_survive_a_plan_that_still_has_them(renderer):
    one = renderer(SIZE)
    one.render(room(), vpls=4)
    albedo, atlas, lights = (
        one.executor.resource(s) for s in (("gbuffer", "albedo"), ("shadow_maps", "atlas"), ("vpl", "vpls"))
    )
    one.render(room(), vpls=5)
    assert one.executor.resource(("gbuffer", "albedo")) is albedo
    assert one.executor.resource(("shadow_maps", "atlas")) is atlas  # still one layer of tiles
    assert one.executor.resource(("vpl", "vpls")) is not lights  # room for another


def test_programs_are_built_once(renderer):
    one = renderer(SIZE)
    one.render(room(), vpls=4)
    built = one.executor.library.compiled
    one.render(room(), vpls=4, seed=1)
    one.render(room(), vpls=9)
    one.render(build(plane(), plane(height=-1)), vpls=9)
    assert one.executor.library.compiled == built


def test_a_scene_that_is_gone_leaves_no_vertex_arrays(renderer):
    one = renderer(SIZE)
    for scene in (room(), build(plane())):
        one.render(scene, vpls=4)
    drawn = {key for program in one.executor.library._programs.values() for key in program.arrays}
    assert drawn == {None, one._buffers, one._buffers.cluster_buffers}


def test_memory_is_given_back_with_the_plan(renderer):
    one = renderer(SIZE)
    one.render(room(), vpls=4)
    few = one.memory()
    one.render(room(), vpls=300)
    many = one.memory()
    one.render(room(), vpls=4)
    assert one.memory() == few
    assert many["textures"] - few["textures"] >= 4 * 2**20
    g = 40 * 24 * (8 + 8 + 4 + 16 + 4) + 32 * 32 * 8  # normals, albedo, depth, radiance, display; lists of tiles
    atlas = one.executor.resource(("shadow_maps", "atlas"))
    assert few["textures"] == g + atlas.nbytes


def test_two_renderers_side_by_side_do_not_mix(renderer):
    one, other = renderer(SIZE), renderer(SIZE, "forward")
    scene, second = room(), build(plane())
    expected = [one.render(scene, vpls=6).radiance, other.render(second, vpls=6).radiance]
    for _ in range(2):
        np.testing.assert_array_equal(one.render(scene, vpls=6).radiance, expected[0])
        np.testing.assert_array_equal(other.render(second, vpls=6).radiance, expected[1])


def test_closing_one_leaves_the_other(renderer):
    other = renderer(SIZE)
    before = other.render(room(), vpls=4).radiance
    with Renderer(SIZE, device="software") as one:
        one.render(room(), vpls=4)
    np.testing.assert_array_equal(other.render(room(), vpls=4).radiance, before)


def test_closing_a_context_leaves_the_samplers_of_the_one_that_is_current():
    """Names of samplers count up from 1 in each context."""
    first, second = Gpu("software"), Gpu("software")
    with first.ctx:
        first.sampler(linear=True)
    with second.ctx:
        kept = second.sampler(linear=True)
    second.ctx.__enter__()
    first.close()
    with second.ctx:
        kept.use(3)
        assert second.ctx.error == "GL_NO_ERROR"
    second.close()


@pytest.mark.usefixtures("software_gpu")  # says that it needs OpenGL: its thread cannot
def test_a_renderer_works_in_the_thread_that_made_it():
    found = []

    def work():
        with Renderer(SIZE, device="software") as one:
            found.append(one.render(room(), vpls=4).radiance.max())

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert found[0] > 0


def test_time_moves_what_moves(renderer):
    scene = room()
    moving = replace(scene, lights=(replace(scene.spotlight, motion=LissajousMotion((0.3, 0, 0.3), (1, 1))),))
    one = renderer(SIZE)
    at_start, later = (one.render(moving, vpls=4, time=time).radiance for time in (0.0, 2.0))
    assert not np.array_equal(at_start, later)
    there = replace(scene, lights=(replace(moving.spotlight.at(2.0), motion=None),))
    np.testing.assert_array_equal(one.render(there, vpls=4).radiance, later)


# What is measured


def test_every_pass_is_timed_in_every_frame(renderer):
    one, scene, measurement = renderer(SIZE), room(), Measurement()
    plan = one.plan(scene, 8)
    for frame in range(DELAY + 2):
        one.draw(scene, plan, measurement=measurement)
        assert len(measurement.laps) == max(0, frame + 1 - DELAY)  # never waits for the device
    one.finish(measurement)
    assert len(measurement.laps) == len(measurement.frame_ms) == len(measurement.counters) == DELAY + 2
    steps = [step.name for step in plan.steps]
    assert [entry["name"] for entry in measurement.passes()] == steps
    for laps, wall in zip(measurement.laps, measurement.frame_ms, strict=True):
        assert list(laps) == steps
        assert all(gpu >= 0 and cpu > 0 for gpu, cpu in laps.values())
        assert sum(cpu for _, cpu in laps.values()) < wall
        assert sum(gpu for gpu, _ in laps.values()) < wall
    counters = measurement.counters[-1]
    assert 0 < counters.pop("lights_skipped") < 32 * 32 * 8
    assert counters == {"vpls_alive": 8, "maps_drawn": 9, "lights_dropped": 0}
    assert measurement.median_frame_ms() == pytest.approx(np.median(measurement.frame_ms), abs=1e-4)


def test_frames_without_a_record_leave_no_times(renderer):
    one, scene, measurement = renderer(SIZE), room(), Measurement()
    one.render(scene, vpls=4)
    one.finish(measurement)
    assert measurement == Measurement()


# What is refused


@pytest.mark.parametrize("size", [(0, 4), (4, -1), (4.0, 4), (4,), (4, 4, 4), ("4", 4), 4, None])
def test_a_size_that_is_none_is_one_line(size):
    with pytest.raises(SettingError, match=r"^size .*: wants two whole numbers above 0, width and height$"):
        Renderer(size, device="software")


def test_a_size_beyond_the_driver_is_one_line(gpu):
    with pytest.raises(SettingError, match=rf"^size {gpu.max_size + 1}x2: this driver draws at most {gpu.max_size}"):
        Renderer((gpu.max_size + 1, 2), device="software")


def test_numpys_numbers_are_numbers(renderer):
    one = renderer((np.int64(8), np.int32(4)))
    one.render(room(), vpls=4, seed=np.int64(3))
    assert one.size == (8, 4)


def test_a_fault_in_the_graph_shows_before_a_device_is_looked_for():
    with pytest.raises(GraphError, match="did you mean 'deferred'"):
        Renderer(SIZE, "defered", device="no such device")


@pytest.mark.parametrize("seed", [-1, 1.5, "1", None])
def test_a_seed_that_is_none_is_one_line(renderer, seed):
    with pytest.raises(SettingError, match=r"^seed .*: wants a whole number of 0 or more$"):
        renderer(SIZE).render(room(), vpls=4, seed=seed)


@pytest.mark.parametrize("vpls", [-1, 10**9, 1.5])
def test_a_number_of_vpls_that_is_none_is_one_line(renderer, vpls):
    with pytest.raises(GraphError, match=r"vpl\.count: is .*, but wants a whole number at least 0"):
        renderer(SIZE).render(room(), vpls=vpls)


def test_memory_that_the_driver_refuses_is_one_line_and_the_next_frame_is_fine(renderer):
    one = renderer(SIZE, set={"shadow_maps.budget": 65536, "shadow_maps.vpl_size": 2048})
    with pytest.raises(DeviceError, match=r"^shadow_maps\.atlas: .*; use "):
        one.render(room(), vpls=1500)
    assert one.render(room(), vpls=2).radiance.max() > 0


def test_a_texture_beyond_the_driver_is_one_line(renderer, monkeypatch):
    one = renderer(SIZE)
    monkeypatch.setitem(one.gpu.__dict__, "max_size", 4)
    scene = textured(build(plane()), np.zeros((2, 5, 3)), np.zeros((4, 2)))
    with pytest.raises(
        DeviceError, match=r"^pattern: 5x2 pixels, and this driver takes at most 4; scale the image down$"
    ):
        one.render(scene, vpls=0)


def test_extreme_lights_give_finite_numbers(renderer):
    scene = room()
    for light in (
        replace(scene.spotlight, emission=(1e12, 1e-12, 0.0)),
        replace(scene.spotlight, fov=0.01),
        replace(scene.spotlight, fov=179.9),
        Spotlight((1.0, 1.0, 1.0), (-1.0, -1.0, -1.0), 60.0),  # in the corner
    ):
        image = renderer(SIZE).render(replace(scene, lights=(light,)), vpls=8)
        assert np.isfinite(image.radiance).all()
        assert image.radiance.min() >= 0
