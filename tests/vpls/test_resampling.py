"""VPLs chosen by their effect on the image: unbiased, and better where most VPLs light nothing in view."""

from dataclasses import replace

import numpy as np
import pytest
from distance import rel_mse
from hypothesis import given
from hypothesis import strategies as st
from small_scenes import build, plane, room, two_rooms

from deferred_ir.rays.tracer import Tracer
from deferred_ir.scene.camera import Camera
from deferred_ir.scene.motion import CameraMotion
from deferred_ir.truth.path_tracer import PathTracer
from deferred_ir.vpls.cast import NONE, Vpls, cast
from deferred_ir.vpls.kernel import VplLimits
from deferred_ir.vpls.ray_sum import sum_radiance
from deferred_ir.vpls.resampling import EVEN, PROBES, estimate_effects, find_probes, resample

SIZE = (64, 48)
ROOMS = two_rooms()


def make_limits(scene=ROOMS):
    return VplLimits.from_angle(179.9, 0.02 * scene.geometry.diagonal)


def cast_candidates(scene=ROOMS, count=1024, seed=0, bounces=1):
    return cast(scene.emitters, Tracer(scene), count, "sobol", seed, bounces=bounces)


def choose(scene, count, seed, bounces=1, factor=16):
    """Choose VPLs as a render with `vpl.candidates` does."""
    tracer = Tracer(scene)
    vpls = cast(scene.emitters, tracer, count * factor, "sobol", seed, bounces=bounces)
    seen = find_probes(tracer, scene.camera, SIZE, seed)
    return resample(vpls, estimate_effects(tracer, seen, vpls, make_limits(scene)), count, seed)


def render_indirect(scene, vpls, size=(16, 12)):
    tracer = Tracer(scene)
    seen = PathTracer(scene, tracer).trace_camera_rays(size)
    return sum_radiance(tracer, seen, vpls, make_limits(scene)).reshape(size[1], size[0], 3)


def make_random_vpls(count, seed=0):
    """Return VPLs anywhere, of any power."""
    rng = np.random.default_rng(seed)
    normal = rng.normal(size=(count, 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    return Vpls(rng.random((count, 3)), normal, rng.random((count, 3)) ** 4, np.arange(count))


def read_vpls(one):
    return one.executor.resource(("vpl", "vpls")).records


# The choice


@pytest.mark.slow
def test_a_choice_is_right_on_average_in_every_pixel():
    vpls = cast_candidates()
    tracer = Tracer(ROOMS)
    effect = estimate_effects(tracer, find_probes(tracer, ROOMS.camera, SIZE), vpls, make_limits())
    images = np.array([render_indirect(ROOMS, resample(vpls, effect, 32, seed), (6, 4)) for seed in range(150)])
    error = images.std(axis=0) / np.sqrt(len(images))
    off = np.abs(images.mean(axis=0) - render_indirect(ROOMS, vpls, (6, 4))) / error
    assert off.max() < 4.5  # of 72 values
    assert np.sqrt((off**2).mean()) < 1.5


@pytest.mark.parametrize("bounces", [1, 3])
@pytest.mark.slow
def test_images_are_right_on_average(bounces):
    truth = render_indirect(ROOMS, cast_candidates(count=8192, seed=99, bounces=bounces)).mean()
    means = [render_indirect(ROOMS, choose(ROOMS, 32, seed, bounces)).mean() for seed in range(48)]
    assert np.std(means) / np.sqrt(len(means)) < 0.03 * truth
    assert abs(np.mean(means) - truth) < 3.5 * np.std(means) / np.sqrt(len(means))


@given(st.lists(st.floats(0, 1e6), min_size=2, max_size=40), st.integers(1, 12), st.integers(0, 9))
def test_none_becomes_brighter_than_its_even_share_allows(effect, count, seed):
    vpls = make_random_vpls(len(effect))
    kept = resample(vpls, np.array(effect), count, seed)
    assert len(kept) <= max(count, 1)
    assert len(set(kept.ray)) == len(kept)
    if len(vpls) > count:
        gain = kept.emission / vpls.emission[kept.ray]
        # One that is drawn again has had its share of the probability.
        assert gain.max() <= max(len(vpls) / (count * EVEN), 2 / EVEN) * 1.001
        assert gain.min() > 0


@pytest.mark.slow
def test_power_is_the_same_on_average():
    vpls, rng = make_random_vpls(500), np.random.default_rng(4)
    for effect in (rng.random(500) ** 8, np.eye(500)[7], np.zeros(500)):
        sums = np.array([resample(vpls, effect, 50, seed).emission.sum(axis=0) for seed in range(200)])
        error = sums.std(axis=0) / np.sqrt(len(sums))
        assert (np.abs(sums.mean(axis=0) - vpls.emission.sum(axis=0)) < 4 * error).all()


def test_without_any_effect_the_choice_is_even_and_keeps_its_strata():
    vpls = make_random_vpls(4096)
    kept = resample(vpls, np.zeros(4096), 64)
    np.testing.assert_allclose(kept.emission, vpls.emission[kept.ray] * 64, rtol=1e-9)
    octants = np.bincount((kept.position > 0.5) @ (1, 2, 4), minlength=8)
    assert octants.min() >= 5
    assert octants.max() <= 11


def test_no_more_than_wanted_are_all_returned_unchanged():
    vpls = make_random_vpls(10)
    for count in (10, 11, 1000):
        assert resample(vpls, np.arange(10.0), count) is vpls
    assert resample(NONE, np.zeros(0), 0) is NONE


def test_one_that_does_nearly_all_is_one_light_of_many_draws():
    vpls = make_random_vpls(20)
    kept = resample(vpls, np.eye(20)[3], 10)
    assert len(kept) < 10
    assert (kept.ray == 3).sum() == 1


def test_vpls_at_one_point_are_fine():
    vpls = replace(make_random_vpls(30), position=np.full((30, 3), 0.25))
    assert len(resample(vpls, np.ones(30), 10)) == 10


# Effects


def test_effects_are_what_a_pixel_gets_over_what_all_give_it():
    tracer, vpls = Tracer(ROOMS), cast_candidates(count=64)
    seen = find_probes(tracer, ROOMS.camera, SIZE)
    grey = replace(vpls, emission=np.repeat(vpls.emission @ [[0.2126], [0.7152], [0.0722]], 3, axis=1))
    each = np.array(
        [
            sum_radiance(
                tracer,
                seen,
                Vpls(*(getattr(grey, f)[[i]] for f in ("position", "normal", "emission", "ray"))),
                make_limits(),
            )[:, 0]
            for i in range(len(vpls))
        ]
    )
    total = each.sum(axis=0)
    share = each[:, total > 0] / total[total > 0]
    np.testing.assert_allclose(
        estimate_effects(tracer, seen, vpls, make_limits()), np.sqrt((share**2).sum(axis=1)), rtol=1e-4
    )


@pytest.mark.parametrize("count", [0, 5, 3000])
def test_any_number_of_threads_gives_the_same(count):
    tracer, vpls = Tracer(ROOMS), cast_candidates(count=count)
    seen = find_probes(tracer, ROOMS.camera, SIZE)
    one, four = (estimate_effects(tracer, seen, vpls, make_limits(), threads=threads) for threads in (1, 4))
    np.testing.assert_array_equal(one, four)
    assert one.shape == (len(vpls),)


def test_extreme_power_and_no_clamp_leave_effects_finite():
    tracer, vpls = Tracer(ROOMS), cast_candidates(count=64)
    seen = find_probes(tracer, ROOMS.camera, SIZE)
    unclamped = VplLimits.from_angle(150.0, 0.0)
    usual = estimate_effects(tracer, seen, vpls, unclamped)
    for factor in (1e-300, 1e200):
        extreme = replace(vpls, emission=vpls.emission * factor)
        np.testing.assert_allclose(estimate_effects(tracer, seen, extreme, unclamped), usual, rtol=1e-5)
    dark = replace(vpls, emission=vpls.emission * 0)
    np.testing.assert_array_equal(estimate_effects(tracer, seen, dark, make_limits()), 0)


def test_probes_are_pixels_of_the_image_all_over_it():
    scene, tracer = room(), Tracer(room())
    seen = find_probes(tracer, scene.camera, (16, 8))
    assert len(seen.face) == PROBES
    pixels = PathTracer(scene, tracer).trace_camera_rays((16, 8)).position
    nearest = np.linalg.norm(seen.position[:, None] - pixels, axis=2)
    assert nearest.min(axis=1).max() < 1e-5
    assert len(set(nearest.argmin(axis=1))) > 60  # of 128


def test_probes_pass_over_the_background():
    small = build(plane(0.3), camera=Camera((0, 3, 0.1), (0, 0, 0), fov=40.0))
    seen = find_probes(Tracer(small), small.camera, (64, 64))
    assert 20 < len(seen.face) <= PROBES
    assert seen.hit.all()
    away = replace(small.camera, look_at=(0.0, 9.0, 0.0))
    assert len(find_probes(Tracer(small), away, (64, 64)).face) == 0


# What it is for


@pytest.mark.slow
def test_the_error_falls_where_little_of_the_light_reaches_what_is_seen():
    truth = render_indirect(ROOMS, cast_candidates(count=4096, seed=99))
    everywhere = np.ones(truth.shape[:2], bool)
    plain = [
        rel_mse(render_indirect(ROOMS, cast_candidates(count=64, seed=seed)), truth, everywhere) for seed in range(6)
    ]
    better = [rel_mse(render_indirect(ROOMS, choose(ROOMS, 64, seed)), truth, everywhere) for seed in range(6)]
    assert np.mean(better) < np.mean(plain) / 3


@pytest.mark.slow
def test_it_does_no_harm_where_all_of_the_light_is_seen():
    scene = room()
    truth = render_indirect(scene, cast_candidates(scene, 4096, 99))
    everywhere = np.ones(truth.shape[:2], bool)
    plain = [rel_mse(render_indirect(scene, cast_candidates(scene, 64, seed)), truth, everywhere) for seed in range(6)]
    better = [rel_mse(render_indirect(scene, choose(scene, 64, seed)), truth, everywhere) for seed in range(6)]
    assert np.mean(better) < 1.2 * np.mean(plain)


# In a frame


def test_one_candidate_a_vpl_is_what_it_always_was(renderer):
    one = renderer(SIZE, set={"vpl.candidates": 1})
    image = one.render(ROOMS, vpls=32, seed=3).radiance
    vpls = cast_candidates(count=32, seed=3)
    np.testing.assert_allclose(read_vpls(one)["position"], vpls.position, atol=1e-5)  # lifted off their surfaces
    np.testing.assert_array_equal(read_vpls(one)["emission"], vpls.emission.astype("f4"))
    np.testing.assert_array_equal(image, renderer(SIZE).render(ROOMS, vpls=32, seed=3).radiance)


def test_a_frame_with_candidates_has_as_many_vpls_and_repeats_itself(renderer):
    one = renderer(SIZE, set={"vpl.candidates": 8})
    first = one.render(ROOMS, vpls=32, seed=1).radiance
    assert one.executor.counters["vpls_alive"] == len(read_vpls(one))
    assert 28 <= one.executor.counters["vpls_alive"] <= 32
    np.testing.assert_array_equal(one.render(ROOMS, vpls=32, seed=1).radiance, first)
    assert not np.array_equal(one.render(ROOMS, vpls=32, seed=2).radiance, first)


def test_bounces_bring_more_than_count_and_never_more_than_there_is_room_for(renderer):
    one = renderer(SIZE, set={"vpl.candidates": 4, "vpl.bounces": 3})
    one.render(ROOMS, vpls=32)
    assert 34 < one.executor.counters["vpls_alive"] <= 3 * 32


def test_what_misses_is_replaced_by_what_does_not(renderer):
    half = build(plane(0.4), camera=Camera((0, 2, 2), (0, 0, 0)))
    plain, more = renderer(SIZE), renderer(SIZE, set={"vpl.candidates": 8})
    plain.render(half, vpls=32)
    more.render(half, vpls=32)
    assert plain.executor.counters["vpls_alive"] < 20
    assert more.executor.counters["vpls_alive"] == 32


@pytest.mark.parametrize("vpls", [0, 1])
def test_no_vpls_and_a_single_one(renderer, vpls):
    one = renderer(SIZE, set={"vpl.candidates": 16})
    assert np.isfinite(one.render(ROOMS, vpls=vpls).radiance).all()
    assert one.executor.counters["vpls_alive"] == vpls


def test_a_camera_that_sees_nothing_still_gets_vpls(renderer):
    scene = build(plane(), camera=Camera((0, 2, 0), (0, 9, 0), up=(1, 0, 0)))
    one = renderer(SIZE, set={"vpl.candidates": 4})
    assert not one.render(scene, vpls=16).radiance.any()
    assert one.executor.counters["vpls_alive"] == 16


def test_the_choice_is_for_the_camera_of_the_frame(renderer):
    there = Camera((-1.8, 0.5, -0.9), (-0.5, -1.0, 0.5), fov=70.0)
    start = replace(ROOMS.camera, motion=None)
    motion = CameraMotion(
        times=(0.0, 1.0), positions=(start.position, there.position), look_ats=(start.look_at, there.look_at)
    )
    moving = replace(ROOMS, camera=replace(start, motion=motion))
    one = renderer(SIZE, set={"vpl.candidates": 8})
    later = one.render(moving, vpls=16, time=1.0).radiance
    still = replace(ROOMS, camera=replace(moving.camera.at(1.0), motion=None))
    np.testing.assert_array_equal(one.render(still, vpls=16).radiance, later)
    at_end = read_vpls(one)["position"].copy()
    one.render(moving, vpls=16)
    assert not np.array_equal(read_vpls(one)["position"], at_end)
