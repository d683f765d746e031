"""Paths of several bounces: their power, and that the first bounce stays the same."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from small_scenes import box, build, room, sphere

from deferred_ir.base.colour import LUMINANCE
from deferred_ir.rays.tracer import Tracer
from deferred_ir.sampling.patterns import resample_systematically
from deferred_ir.scene.lights.spotlight import Spotlight
from deferred_ir.vpls.cast import cast

LIGHT = Spotlight((0.0, 0.0, 0.0), (0.0, -1.0, 0.0), 120.0, (3.0, 2.0, 1.0))


def make_closed_box(albedo):
    """Return an empty box of one albedo."""
    light = Spotlight((-0.4, 0.9, 0.3), (0.1, -1.0, -0.1), 90.0, (3.0, 2.5, 2.0))
    return build(box((-1, -1, -1), (1, 1, 1), (albedo, albedo, albedo)), spotlight=light)


def sum_bounces(vpls):
    """Return the summed emission of each bounce, (bounces, 3); the rays of each bounce are numbered from 0."""
    starts = [0, *(np.flatnonzero(np.diff(vpls.ray) < 0) + 1), len(vpls)]
    return [vpls.emission[a:b].sum(axis=0) for a, b in pairwise(starts)]


def test_in_a_closed_scene_of_one_albedo_power_is_the_geometric_series():
    scene = build(sphere(subdivisions=4, albedo=(0.6, 0.6, 0.6)), spotlight=LIGHT)
    flat = build(*[strip_normals(sphere(subdivisions=4, albedo=(0.6, 0.6, 0.6)))], spotlight=LIGHT)
    sums = sum_bounces(cast([LIGHT], Tracer(flat), 256, "sobol", bounces=6))
    assert len(sums) == 6
    for one, next_one in pairwise(sums):
        np.testing.assert_allclose(next_one, 0.6 * one, rtol=1e-9)
    # Smooth normals differ from the facets': the series then holds on average only.
    smooth = sum_bounces(cast([LIGHT], Tracer(scene), 4096, "sobol", bounces=3))
    np.testing.assert_allclose(smooth[2], 0.36 * smooth[0], rtol=5e-3)


def strip_normals(mesh):
    return type(mesh)(mesh.positions, mesh.faces, mesh.albedo)


def test_fewer_paths_go_on_so_that_each_carries_about_the_same():
    scene = make_closed_box(0.5)
    vpls = cast(scene.emitters, Tracer(scene), 512, "sobol", bounces=4)
    starts = [0, *(np.flatnonzero(np.diff(vpls.ray) < 0) + 1), len(vpls)]
    counts = np.diff(starts)
    np.testing.assert_allclose(counts[2] / counts[1], 0.5, atol=0.02)
    np.testing.assert_allclose(counts[3] / counts[2], 0.5, atol=0.02)


def test_the_first_bounce_does_not_depend_on_how_many_follow():
    scene = room()
    one, four = (cast(scene.emitters, Tracer(scene), 64, "sobol", 3, bounces=b) for b in (1, 4))
    np.testing.assert_array_equal(four.emission[: len(one)], one.emission)
    np.testing.assert_array_equal(four.position[: len(one)], one.position)


def test_later_bounces_are_unbiased_where_albedos_differ():
    """The mean power of the second bounce over many seeds, against all paths followed without resampling."""
    red = build(
        strip_normals(sphere(subdivisions=2, albedo=(0.9, 0.1, 0.3))),
        spotlight=LIGHT,
    )
    tracer = Tracer(red)
    seconds = np.array([sum_bounces(cast([LIGHT], tracer, 32, "random", seed, bounces=2))[1] for seed in range(200)])
    firsts = np.array([sum_bounces(cast([LIGHT], tracer, 32, "random", seed, bounces=2))[0] for seed in range(200)])
    expected = firsts.mean(axis=0) * (0.9, 0.1, 0.3)
    error = seconds.std(axis=0) / np.sqrt(200)
    assert np.all(np.abs(seconds.mean(axis=0) - expected) < 4 * error + 1e-9)


def test_a_black_scene_ends_the_paths():
    scene = make_closed_box(0.0)
    assert len(cast(scene.emitters, Tracer(scene), 16, "sobol", bounces=50)) == 0


def test_white_walls_and_fifty_bounces_stay_finite():
    scene = make_closed_box(1.0)
    vpls = cast(scene.emitters, Tracer(scene), 16, "sobol", bounces=50)
    assert np.isfinite(vpls.emission).all()
    luminous = [total @ LUMINANCE for total in sum_bounces(vpls)]
    assert max(luminous) == pytest.approx(min(luminous), rel=1e-6)


@given(st.lists(st.floats(0, 1e6), min_size=1, max_size=50), st.integers(1, 80), st.floats(0, 1, exclude_max=True))
def test_systematic_resampling_draws_each_in_proportion(powers, count, offset):
    power = np.array(powers) + 1e-6
    drawn = np.bincount(resample_systematically(power, count, offset), minlength=len(power))
    assert drawn.sum() == count
    assert np.all(np.abs(drawn - count * power / power.sum()) < 1 + 1e-6)


def test_rays_of_a_disc_light_start_all_over_it():
    light = Spotlight((0.0, 0.5, 0.0), (0.0, -1.0, 0.0), 60.0, (1.0, 1.0, 1.0), radius=0.3)
    scene = make_closed_box(0.5)
    point, disc = (cast([lamp], Tracer(scene), 256, "sobol") for lamp in (Spotlight(*make_point_light(light)), light))
    assert np.abs(point.position - disc.position).max() > 0.2
    np.testing.assert_allclose(disc.emission.sum(axis=0), point.emission.sum(axis=0), rtol=1e-9)


def make_point_light(light):
    return light.position, light.look_at, light.fov, light.emission
