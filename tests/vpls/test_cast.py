"""Casting VPLs: where they lie, and that their emission adds up to the light's power."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from closed_forms import mean_cone_factor
from small_scenes import box, build, plane, room, scaled, sphere, textured

from deferred_ir.base.colour import linear_from_srgb
from deferred_ir.rays.tracer import Tracer
from deferred_ir.sampling.patterns import PATTERNS, resample_systematically
from deferred_ir.sampling.warps import lift_to_hemisphere, square_to_disc
from deferred_ir.scene.lights.spotlight import Spotlight
from deferred_ir.scene.surfaces import brdf
from deferred_ir.vpls import cast as vpls
from deferred_ir.vpls.cast import cast

ALBEDO = (0.5, 0.25, 0.125)
LIGHT = Spotlight((0.1, 0.2, -0.1), (0.3, -1.0, 0.4), 100.0, (3.0, 2.0, 1.0))
CLOSED = build(box((-1, -1, -1), (1, 1, 1), ALBEDO), spotlight=LIGHT)


def test_the_closed_form_is_that_of_the_spotlights_own_cone():
    points = square_to_disc(np.random.default_rng(0).random((400_000, 2))) * math.sin(math.radians(50))
    directions = np.column_stack([points, np.sqrt(1 - (points**2).sum(axis=1))])
    assert Spotlight((0, 0, 0), (0, 0, 1), 100.0).cone(directions).mean() == pytest.approx(
        mean_cone_factor(100), rel=3e-3
    )


@pytest.mark.parametrize("fov", [0.1, 30.0, 100.0, 160.0, 179.99])
def test_a_closed_room_gives_back_all_that_the_light_sends(fov):
    light = replace(LIGHT, fov=fov)
    lights = cast([light], Tracer(CLOSED), 16384, "sobol", seed=1)
    r = math.sin(math.radians(fov) / 2)
    expected = np.array(light.emission) * r**2 * ALBEDO * mean_cone_factor(fov)
    np.testing.assert_allclose(lights.emission.sum(axis=0), expected, rtol=1e-3)


@pytest.mark.parametrize("pattern", PATTERNS)
@pytest.mark.parametrize("count", [1, 3, 100])
@pytest.mark.slow
def test_every_pattern_and_count_is_unbiased(pattern, count):
    tracer, seeds = Tracer(CLOSED), max(1000 // count, 60)
    sums = [cast([LIGHT], tracer, count, pattern, seed).emission.sum(axis=0) for seed in range(seeds)]
    expected = np.array(LIGHT.emission) * math.sin(math.radians(50)) ** 2 * ALBEDO * mean_cone_factor(100)
    np.testing.assert_allclose(np.mean(sums, axis=0), expected, rtol=0.05)


@pytest.mark.parametrize("normal", [(0.0, 1.0, 0.0), (0.48, 0.8, -0.36)])
def test_the_light_that_a_surface_gets_is_what_its_vpls_send_out_again(normal):
    """On part of the room, the floor, against the irradiance integrated over it: not just the sum is right.

    Irradiance goes with the cosine at the shading normal, which leans in the second case.
    """
    floor = replace(plane(1.0, -1.0, albedo=(1, 1, 1)), normals=np.tile(normal, (4, 1)))
    scene = build(floor, box((-1, -1, -1), (1, 1.0, 1), (0, 0, 0)), spotlight=LIGHT)
    keep = np.ones(len(scene.geometry.faces), bool)  # without the box's own floor
    keep[2:] = scene.geometry.positions[scene.geometry.faces[2:]][..., 1].max(axis=1) > -1
    geometry = replace(
        scene.geometry, faces=scene.geometry.faces[keep], face_materials=scene.geometry.face_materials[keep]
    )
    lights = cast([LIGHT], Tracer(replace(scene, geometry=geometry)), 16384, "sobol")
    n = 400
    axis = (np.arange(n) + 0.5) / n * 2 - 1
    x, z = np.meshgrid(axis, axis)
    way = np.stack([x, np.full_like(x, -1.0), z], axis=-1) - np.array(LIGHT.position)
    distance = np.linalg.norm(way, axis=-1)
    towards = way / distance[..., None]
    irradiance = np.maximum(towards @ LIGHT.axis, 0) * LIGHT.cone(towards) / distance**2
    irradiance *= np.maximum(-towards @ np.array(normal), 0)
    power = irradiance.sum() * (2 / n) ** 2  # a diffuse white surface: radiance/pi * area, so emission is power/pi
    np.testing.assert_allclose(lights.emission.sum(axis=0), np.array(LIGHT.emission) * power / math.pi, rtol=2e-3)


def test_vpls_lie_on_surfaces_and_look_to_where_the_ray_came_from():
    lights = cast([LIGHT], Tracer(CLOSED), 500, "random")
    assert len(lights) == len(lights.position) == len(lights.normal) == len(lights.emission) > 400
    np.testing.assert_allclose(np.abs(lights.position).max(axis=1), 1, atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(lights.normal, axis=1), 1)
    way = lights.position - LIGHT.position
    assert ((way * lights.normal).sum(axis=1) < 0).all()
    off_axis = np.degrees(np.arccos(way @ LIGHT.axis / np.linalg.norm(way, axis=1)))
    assert off_axis.max() < 50.001
    assert (np.diff(lights.ray) > 0).all()


def test_the_same_ray_makes_the_same_vpl_whatever_else_is_hit():
    whole = cast([LIGHT], Tracer(CLOSED), 64, "halton", seed=4)
    floor = cast([LIGHT], Tracer(build(plane(1.0, -1.0, ALBEDO))), 64, "halton", seed=4)
    both = np.isin(whole.ray, floor.ray)
    on_floor = whole.position[both][:, 1] < -0.999
    assert 5 < on_floor.sum() == len(floor)
    np.testing.assert_allclose(whole.emission[both][on_floor], floor.emission, rtol=1e-12)


def test_rays_that_miss_are_not_replaced():
    light = replace(LIGHT, fov=90.0, look_at=(0.1, -1.0, -0.1))
    lights = cast([light], Tracer(build(plane(0.3, -1.0))), 1000, "random")
    assert 0 < len(lights) < 200
    full = cast([light], Tracer(build(plane(99.0, -1.0))), 1000, "random")
    same = np.isin(full.ray, lights.ray)
    np.testing.assert_allclose(full.emission[same], lights.emission)  # each still carries 1/1000


def test_a_ray_into_the_void_makes_none():
    assert len(cast([replace(LIGHT, look_at=(0, 9, 0))], Tracer(build(plane(1.0, -1.0))), 16)) == 0


def test_black_surfaces_make_none():
    black = build(box((-1, -1, -1), (1, 1, 1), (0, 0, 0)))
    assert len(cast([LIGHT], Tracer(black), 64)) == 0
    red = build(box((-1, -1, -1), (1, 1, 1), (0.5, 0, 0)))
    lights = cast([LIGHT], Tracer(red), 64)
    assert len(lights) > 50
    np.testing.assert_array_equal(lights.emission[:, 1:], 0)


def test_a_dark_light_makes_none():
    assert len(cast([replace(LIGHT, emission=(0, 0, 0))], Tracer(CLOSED), 64)) == 0


def test_no_rays_make_none_and_need_no_tracer():
    assert len(cast([LIGHT], None, 0)) == 0


@pytest.mark.parametrize("pattern", PATTERNS)
def test_the_seed_decides(pattern):
    tracer = Tracer(CLOSED)
    one, again, other = (cast([LIGHT], tracer, 50, pattern, seed) for seed in (0, 0, 1))
    np.testing.assert_array_equal(one.position, again.position)
    np.testing.assert_array_equal(one.emission, again.emission)
    assert not np.array_equal(one.position, other.position)


@pytest.mark.parametrize("smooth", [True, False])
def test_the_inside_of_a_tessellated_sphere_keeps_the_energy(smooth):
    """Smooth normals bend at the rim of each facet; the sum must not."""
    ball = replace(sphere(1.0, 4), albedo=ALBEDO)
    scene = build(ball if smooth else replace(ball, normals=None))
    lights = cast([LIGHT], Tracer(scene), 16384, "sobol")
    expected = np.array(LIGHT.emission) * math.sin(math.radians(50)) ** 2 * ALBEDO * mean_cone_factor(100)
    np.testing.assert_allclose(lights.emission.sum(axis=0), expected, rtol=2e-3)
    assert len(lights) > 16000


def test_a_vpl_has_the_albedo_of_the_texel_where_its_ray_lands():
    pixels = np.array([[[255, 0, 0], [0, 255, 0]]])
    scene = textured(build(plane(4.0, -1.0, (1, 1, 1))), pixels, [[0, 0], [1, 0], [1, 1], [0, 1]])
    lights = cast([replace(LIGHT, look_at=(0.1, -1.0, -0.1))], Tracer(scene), 256, "sobol")
    x = lights.position[:, 0]
    share = linear_from_srgb(np.array(0.0)) + np.clip((x + 2) / 4, 0, 1)  # texel centres at -2 and 2
    brightness = lights.emission / LIGHT.emission
    np.testing.assert_allclose(brightness[:, 1] / brightness[:, :2].sum(axis=1), share, atol=1e-5)
    np.testing.assert_array_equal(brightness[:, 2], 0)


def test_vpls_carry_what_glossy_surfaces_reflect_diffusely():
    """Their power is the integral of the diffuse part of the BRDF over all directions, for light at any angle."""
    coat = {"specular": 0.9, "specular_color": (1.0, 2.0, 3.0), "ior": 2.0, "metallic": 0.3}
    scene = replace(CLOSED, materials=(replace(CLOSED.materials[0], **coat),))
    tracer = Tracer(scene)
    origins, directions, carried = vpls._start_rays([LIGHT], scene.bounds, 1024, "sobol", 0)
    hits, rng = tracer.closest(origins, directions), np.random.default_rng(1)
    assert hits.gloss is not None
    expected = np.zeros(3)
    for points in rng.random((256, len(directions), 2)):
        leaving = lift_to_hemisphere(square_to_disc(points), hits.normal)
        kept, _ = brdf.eval(hits.gloss, hits.normal, leaving, -directions)
        expected += (carried * hits.albedo * kept[:, None]).sum(axis=0) / 256
    emission = cast([LIGHT], tracer, 1024, "sobol").emission.sum(axis=0)
    np.testing.assert_allclose(emission, expected, rtol=1e-3)
    assert (emission < 0.95 * 0.7 * cast([LIGHT], Tracer(CLOSED), 1024, "sobol").emission.sum(axis=0)).all()


@pytest.mark.parametrize("scale", [1e-3, 1e3])
def test_units_of_length_do_not_matter(scale):
    small, large = room(), scaled(room(), scale)
    one = cast(small.emitters, Tracer(small), 200, "sobol")
    other = cast(large.emitters, Tracer(large), 200, "sobol")
    np.testing.assert_array_equal(one.ray, other.ray)
    np.testing.assert_allclose(one.position * scale, other.position, atol=1e-5 * scale)
    np.testing.assert_allclose(one.emission * scale**2, other.emission, rtol=1e-4)


def test_rays_on_the_very_rim_of_a_half_space_are_fine(monkeypatch):
    """sin^2 + cos^2 may round to more than 1."""
    rim = np.column_stack([np.zeros(100_000), np.linspace(0, 1, 100_000)])
    monkeypatch.setattr(vpls, "sample_unit_disc", lambda *_: square_to_disc(rim))
    lights = cast([replace(LIGHT, fov=np.nextafter(180, 0))], Tracer(CLOSED), len(rim))
    assert np.isfinite(lights.emission).all()


# More bounces


def sum_bounces(lights: vpls.Vpls, count: int) -> list[np.ndarray]:
    """Return the summed emission of each bounce; `ray` starts at 0 in each."""
    starts = [0, *(np.flatnonzero(np.diff(lights.ray) <= 0) + 1), len(lights)]
    return [lights.emission[a:b].sum(axis=0) for a, b in itertools.pairwise(starts)]


def test_each_bounce_sends_out_the_albedos_share_of_the_one_before():
    sums = sum_bounces(cast([LIGHT], Tracer(CLOSED), 16384, "sobol", bounces=4), 16384)
    assert len(sums) == 4
    for before, after in itertools.pairwise(sums):
        np.testing.assert_allclose(after, before * ALBEDO, rtol=2e-3)


@pytest.mark.slow
def test_few_paths_are_unbiased_over_many_bounces():
    tracer = Tracer(room())
    many = cast([LIGHT], tracer, 16384, "sobol", bounces=5)
    few = [cast([LIGHT], tracer, 16, "random", seed, bounces=5).emission.sum(axis=0) for seed in range(400)]
    np.testing.assert_allclose(np.mean(few, axis=0), many.emission.sum(axis=0), rtol=0.03)


def test_more_bounces_only_add():
    one, three = (cast([LIGHT], Tracer(room()), 64, "sobol", seed=2, bounces=bounces) for bounces in (1, 3))
    np.testing.assert_array_equal(three.position[: len(one)], one.position)
    np.testing.assert_array_equal(three.emission[: len(one)], one.emission)
    assert len(three) > len(one)


def test_a_bounce_takes_fewer_rays_where_there_is_less_to_carry():
    grey = build(box((-1, -1, -1), (1, 1, 1), (0.25, 0.25, 0.25)))
    assert len(cast([LIGHT], Tracer(grey), 256, "sobol", bounces=9)) == 256 + 64 + 16 + 4 + 1


@pytest.mark.parametrize("count", [1, 7, 64])
def test_a_bounce_never_has_more_lights_than_rays_left_the_light(count):
    """Not even where nothing is absorbed and smooth normals raise the power: the buffers rely on it."""
    white = Tracer(build(sphere(1.0, 1, (1.0, 1.0, 1.0))))
    for seed in range(30):
        assert len(cast([LIGHT], white, count, "random", seed, bounces=4)) <= 4 * count


def test_paths_end_on_black():
    scene = build(plane(9.0, -1.0, ALBEDO), plane(9.0, 1.0, (0, 0, 0)))
    lights = cast([replace(LIGHT, look_at=(0.1, -1, -0.1))], Tracer(scene), 64, bounces=3)
    assert len(lights) == 64


def test_a_round_light_sends_out_as_much_as_a_point():
    soft = replace(LIGHT, radius=0.2)
    np.testing.assert_allclose(
        cast([soft], Tracer(CLOSED), 16384, "sobol").emission.sum(axis=0),
        cast([LIGHT], Tracer(CLOSED), 16384, "sobol").emission.sum(axis=0),
        rtol=2e-3,
    )


def test_a_round_lights_rays_start_on_its_disc():
    origins, directions, _ = vpls._start_rays([replace(LIGHT, radius=0.2)], room().bounds, 4096, "sobol", 0)
    off = origins - LIGHT.position
    np.testing.assert_allclose(off @ LIGHT.axis, 0, atol=1e-12)
    radius = np.linalg.norm(off, axis=1)
    assert radius.max() <= 0.2
    assert radius.mean() == pytest.approx(0.2 * 2 / 3, rel=1e-3)
    along = directions - np.outer(directions @ LIGHT.axis, LIGHT.axis)
    assert abs(np.mean(off * along)) < 2e-3  # where a ray starts says nothing about where it goes


@pytest.mark.parametrize("share", [(1.0, 1.0, 1.0), (3.0, 0.0, 1.0), (1e-30, 1e30, 1e30), (0.0, 0.0, 5.0)])
def test_lights_go_on_in_proportion_to_their_power(share):
    drawn = np.bincount(resample_systematically(np.array(share), 1000, 0.37), minlength=3)
    np.testing.assert_allclose(drawn, 1000 * np.array(share) / sum(share), atol=1)
    assert (drawn[np.array(share) == 0] == 0).all()
