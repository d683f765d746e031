"""Reflections by rays: energy, sharpness, their filter, and the VPLs that hits ask."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from small_scenes import build, crooked_room, plane, quad, sphere
from surface_scenes import glossy_room

from deferred_ir.frame.vpl_buffer import VPL
from deferred_ir.pool.vpl_choice import VplChoice
from deferred_ir.rays.tracer import Tracer
from deferred_ir.sampling.warps import square_to_disc
from deferred_ir.scene.camera import Camera
from deferred_ir.scene.lights.environment import Environment
from deferred_ir.scene.surfaces import brdf
from deferred_ir.scene.surfaces.materials import Material

SIZE = (64, 64)


def furnace(**material):
    """A ball alone in light that is the same from all around."""
    scene = build(sphere(1.0, 5), camera=Camera((0.0, 0.0, 4.0), (0.0, 0.0, 0.0), fov=25.0))
    lights = (Environment(radiance=(1.0, 1.0, 1.0)),)
    return replace(scene, materials=(Material("ball", (1.0, 1.0, 1.0), **material),), lights=lights)


def integrate(scene, cosine, count=200_000):
    """Light that the ball's surface reflects at an angle to the camera, by numeric integration of the BRDF."""
    rng = np.random.default_rng(0)
    disc = square_to_disc(rng.random((count, 2)))
    to_light = np.column_stack([disc, np.sqrt(np.maximum(1 - (disc**2).sum(axis=1), 0))])
    normal = np.tile([0.0, 0.0, 1.0], (count, 1))
    viewer = np.tile([np.sqrt(1 - cosine**2), 0.0, cosine], (count, 1))
    material = scene.materials[0]
    albedo, gloss = brdf.make_gloss(
        [material],
        np.zeros(count, int),
        np.ones((count, 3)),
        np.full(count, material.metallic),
        np.full(count, material.roughness),
    )
    kept, _ = brdf.eval(gloss, normal, viewer, to_light)
    _, weights = brdf.sample(gloss, normal, viewer, rng.random((count, 2)))
    return (albedo[:, 0] * kept).mean() + weights[:, 0].mean()


@pytest.mark.parametrize("roughness", [0.0, 1e-4, 0.2, 0.5, 1.0])
@pytest.mark.parametrize("kind", [{"metallic": 1.0}, {"specular": 1.0}], ids=["metal", "plastic"])
def test_a_furnace_wins_no_energy_and_loses_what_one_scattering_does(renderer, roughness, kind):
    scene = furnace(roughness=roughness, **kind)
    one = renderer(SIZE, "accurate", set={"reflection_rays.rays": 32})
    seeds = range(4 if roughness > 0.1 else 1)
    image = np.mean([one.render(scene, vpls=8, seed=seed).radiance for seed in seeds], axis=0)
    middle = image[26:38, 26:38].mean()
    expected = integrate(scene, 0.99)  # the mean over those pixels
    assert middle == pytest.approx(expected, rel=0.02)  # noise is 1 %
    assert expected < 1 + 1e-6
    assert image[16:48, 16:48].max() < 1.1


def test_a_mirror_shows_a_panel_sharply(renderer):
    """Through a mirror the panel's radiance is what it emits, and beside it there is nothing."""
    scene = build(
        plane(2.0),
        quad((-0.5, 0.6, -1.0), (0.5, 0.6, -1.0), (0.5, 1.2, -1.0), (0.0, 0.0, 0.0)),
        camera=Camera((0.0, 0.8, 1.5), (0.0, 0.0, -0.2), fov=40.0),
    )
    mirror = Material("mirror", (1.0, 1.0, 1.0), metallic=1.0, roughness=0.0)
    panel = replace(scene.materials[1], emission=(3.0, 2.0, 1.0), emits_both_sides=True)
    scene = replace(scene, materials=(mirror, panel), lights=())
    image = renderer((128, 128), "accurate").render(scene, vpls=8).radiance
    tracer, rays = Tracer(scene), scene.camera.rays((128, 128)).reshape(-1, 3)
    rays = rays / np.linalg.norm(rays, axis=1, keepdims=True)
    seen = tracer.closest(np.broadcast_to(scene.camera.position, rays.shape), rays)
    floor = seen.face < 2
    ahead = rays - 2 * (rays * seen.normal).sum(axis=1, keepdims=True) * seen.normal
    met = tracer.closest(tracer.lift(seen.position, seen.normal), ahead)
    expected = np.where((met.face >= 2)[:, None], (3.0, 2.0, 1.0), 0.0).reshape(128, 128, 3)
    shows = (floor & seen.hit).reshape(128, 128)
    off = np.abs(image - expected).max(axis=2)[shows]
    assert expected[shows].any()
    assert (off > 0.05).mean() < 0.03  # the panel's outline, a pixel wide
    assert np.median(off[expected.max(axis=2)[shows] > 0]) < 0.02


def test_the_filter_keeps_the_mean_and_takes_noise_away(renderer):
    scene = glossy_room(roughness=0.5)
    smooth = renderer(SIZE, "accurate").render(scene, vpls=64).radiance
    raw = renderer(SIZE, "accurate", set={"filter_reflections.steps": 0}).render(scene, vpls=64).radiance
    many = renderer(SIZE, "accurate", set={"reflection_rays.rays": 32}).render(scene, vpls=64).radiance
    assert smooth.mean() == pytest.approx(raw.mean(), rel=0.01)
    assert ((smooth - many) ** 2).mean() < 0.7 * ((raw - many) ** 2).mean()


def test_matt_scenes_have_no_pass_of_reflections(renderer):
    left = renderer(SIZE, "accurate").plan(crooked_room(), 64).left_out
    assert left["reflection_rays"] == left["filter_reflections"] == "no surface is glossy"


def test_hits_ask_vpls_for_the_light_that_all_of_them_bring():
    """The mean over many draws of one VPL each is the sum over all, shadows included."""
    scene = crooked_room()
    tracer, rng = Tracer(scene), np.random.default_rng(3)
    ways = rng.normal(size=(40, 3))
    at = tracer.closest(np.tile([0.1, 0.1, 0.3], (40, 1)), ways)
    starts = tracer.closest(np.tile([-0.3, 0.2, 0.1], (24, 1)), rng.normal(size=(24, 3)))
    records = np.zeros(24, VPL)
    records["position"], records["z_axis"] = starts.position, starts.normal
    records["emission"] = rng.uniform(0.1, 1, (24, 3))
    records["one_minus_cos"], records["clamp_squared"] = 0.9, 0.05
    choice = VplChoice.from_records(tracer, records)
    expected = np.zeros((40, 3))
    for row in range(24):
        alone = VplChoice.from_records(tracer, records[row : row + 1])
        expected += alone.irradiate(at, rng)
    draws = np.array([choice.irradiate(at, rng) for _ in range(4000)])
    error = draws.std(axis=0) / np.sqrt(len(draws))
    off = np.abs(draws.mean(axis=0) - expected) / np.maximum(error, 1e-9)
    assert (off[expected > 0] < 4.5).all()
    assert not draws[:, expected.sum(axis=1) == 0].any()
    assert not VplChoice.from_records(tracer, records[:0]).irradiate(at, rng).any()
