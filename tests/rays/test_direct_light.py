"""Direct light by rays, compared with the path tracer, which has its own formula and samples."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from small_scenes import build, plane, room, scaled, smooth_scene, sphere

from deferred_ir.rays.direct import trace_direct
from deferred_ir.rays.pixel_surfaces import PixelJob, Surfaces
from deferred_ir.rays.tracer import Tracer
from deferred_ir.scene.camera import Camera
from deferred_ir.scene.lights.spotlight import Spotlight
from deferred_ir.truth.path_tracer import PathTracer

SIZE = (48, 32)


def soft(radius=0.3, scene=None):
    scene = room() if scene is None else scene
    return replace(scene, lights=(replace(scene.spotlight, radius=radius),))


def lit(scene, *, seed=0, samples=4, block=4, threads=None):
    """Irradiance over emission and the truth of it, (H, W); rows as the path tracer has them."""
    tracer = Tracer(scene)
    hits = PathTracer(scene, tracer).trace_camera_rays(SIZE)
    rows = np.flatnonzero(hits.hit)
    seen = Surfaces(rows, *(getattr(hits, name)[rows] for name in ("position", "normal", "shading_normal")))
    return trace_direct(PixelJob(tracer, seen, SIZE, block, seed, threads), samples=samples)[..., 0]


def truth(scene, spp=256):
    tracer = Tracer(scene)
    albedo = PathTracer(scene, tracer).trace_camera_rays(SIZE).albedo.reshape(SIZE[1], SIZE[0], 3)[..., 0]
    radiance = PathTracer(scene, tracer).estimate_direct(SIZE, spp)[..., 0] / scene.spotlight.emission[0]
    return np.divide(radiance * np.pi, albedo, out=np.zeros_like(radiance), where=albedo > 0)


@pytest.mark.parametrize("scene", [room(), smooth_scene()])
def test_a_point_light_is_exact(scene):
    found, expected = lit(scene), truth(scene)
    assert 0 < (expected > 0).mean() < 1
    np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-7)


@pytest.mark.parametrize("samples", [1, 5])
@pytest.mark.slow
def test_the_mean_over_seeds_is_the_soft_shadow(samples):
    """Everywhere: in penumbrae, and where the plane of a surface cuts the disc."""
    scene = soft()
    expected = truth(scene, 512)
    images = np.array([lit(scene, seed=seed, samples=samples) for seed in range(64)])
    error = images.std(axis=0, ddof=1) / np.sqrt(len(images))
    off = np.abs(images.mean(axis=0) - expected)
    assert (off < 4 * error + 0.02 * expected.mean()).mean() > 0.995
    assert images.mean() == pytest.approx(expected.mean(), rel=5e-3)
    assert error.mean() < 0.05 * expected.mean()


def test_a_block_errs_less_than_independent_points_would():
    scene = soft()
    images = np.array([lit(scene, seed=seed, samples=1) for seed in range(24)])
    alone = images.var(axis=0, ddof=1)
    windows = sum(images[:, i : i + 29, j : j + 45] for i in range(4) for j in range(4)) / 16
    independent = sum(alone[i : i + 29, j : j + 45] for i in range(4) for j in range(4)) / 256
    assert windows.var(axis=0, ddof=1).mean() < 0.6 * independent.mean()


def test_points_of_a_pixel_err_less_than_independent_points_would():
    scene = soft()
    one, four = (
        np.array([lit(scene, seed=seed, samples=samples) for seed in range(24)]).var(axis=0, ddof=1).mean()
        for samples in (1, 4)
    )
    assert four < 0.4 * one / 4


def test_a_seed_is_an_image_whatever_the_threads():
    images = [lit(soft(), threads=threads, seed=seed) for threads, seed in ((1, 5), (3, 5), (1, 6))]
    np.testing.assert_array_equal(images[0], images[1])
    assert (images[0] != images[2]).any()


@pytest.mark.parametrize("factor", [1e-3, 1e3])
def test_the_unit_of_length_does_not_matter(factor):
    large = scaled(room(), factor)
    one, other = lit(soft()), lit(soft(0.3 * factor, large)) * factor**2
    assert np.isclose(other, one, rtol=1e-3, atol=1e-3 * one.mean()).mean() > 0.999


def test_no_light_on_the_background_beside_the_cone_or_behind():
    """Nor on a face that looks away and whose shading normal leans to the light."""
    light = Spotlight((0.0, 1.0, 0.0), (0.0, 0.0, 0.0), 30.0, (1.0, 1.0, 1.0), radius=0.05)
    ball = build(sphere(0.5), plane(0.6, -0.5), camera=Camera((0.0, 0.5, 3.0), (0.0, 0.0, 0.0)), spotlight=light)
    image = lit(ball)
    hit = PathTracer(ball, Tracer(ball)).trace_camera_rays(SIZE).hit.reshape(SIZE[1], SIZE[0])
    assert image[hit].max() > 0
    assert not image[~hit].any()
    tracer = Tracer(ball)
    places = np.array([[0.0, -0.6, 0.0], [0.9, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.6, 0.0], [0.0, 0.6, 0.0]])
    normals = np.array([[0, 1, 0], [0, 1, 0], [0, -1, 0], [0, -1, 0], [0, 1, 0]], float)
    seen = Surfaces(np.arange(5), places, normals, np.tile([0.0, 1.0, 0.0], (5, 1)))
    found = trace_direct(PixelJob(tracer, seen, (5, 1)), samples=4)[0, :, 0]
    np.testing.assert_array_equal(found > 0, [False, False, False, False, True])


def test_nothing_seen_is_no_trouble():
    scene = soft()
    nobody = Surfaces(np.zeros(0, int), *[np.zeros((0, 3), np.float32)] * 3)
    assert not trace_direct(PixelJob(Tracer(scene), nobody, SIZE, 4), samples=4).any()
