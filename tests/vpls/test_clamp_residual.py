"""The light that the clamp takes, compared with the path tracer, which has its own code for clamp and cone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from small_scenes import build, plane, quad, room, scaled, sphere, textured

from deferred_ir.frame.frame import NEAR
from deferred_ir.rays.pixel_surfaces import PixelJob, Surfaces, decode_gbuffer
from deferred_ir.rays.tracer import Tracer
from deferred_ir.scene.camera import Camera
from deferred_ir.scene.lights.spotlight import Spotlight
from deferred_ir.truth.path_tracer import PathTracer
from deferred_ir.vpls.cast import cast
from deferred_ir.vpls.clamp_residual import trace_residual
from deferred_ir.vpls.kernel import VplLimits
from deferred_ir.vpls.ray_sum import sum_radiance

SIZE = (48, 32)


def find_seen(scene, tracer, size=SIZE):
    """Return the surfaces behind an image's pixels, top row first, and all hits."""
    hits = PathTracer(scene, tracer).trace_camera_rays(size)
    rows = np.flatnonzero(hits.hit)
    position, normal, smooth = (
        part[rows].astype(np.float32) for part in (hits.position, hits.normal, hits.shading_normal)
    )
    return Surfaces(rows, position, normal, smooth), hits


def trace_near_light(scene, *, clamp, fov=180.0, seed=0, size=SIZE, samples=16.0, block=4, threads=None, **options):
    """Return the radiance that short rays restore, (H, W, 3), top row first."""
    tracer = Tracer(scene)
    seen, hits = find_seen(scene, tracer, size)
    limits = VplLimits.from_angle(fov, clamp * scene.geometry.diagonal)
    job = PixelJob(tracer, seen, size, block, seed, threads)
    image = trace_residual(job, limits, samples=samples, **options)
    return image[..., :3] * hits.albedo.reshape(*image.shape[:2], 3) / np.pi


def trace_lost_light(scene, *, clamp, fov=180.0, bounces=1, spp=192):
    """Return the radiance lost to the limits by the path tracer, (H, W, 3), and the standard error of its mean."""
    tracer = Tracer(scene)
    whole, left = (
        PathTracer(scene, tracer, bounces, **limits).estimate(SIZE, spp, seed=seed)
        for seed, limits in ((1, {}), (2, {"clamp": clamp, "fov": fov}))
    )
    error = np.sqrt(sum(estimate.variance.sum(axis=(0, 1)) for estimate in (whole, left))) / whole.hit.size
    return whole.indirect - left.indirect, error


def make_patterned_room():
    """Return a scene of flat walls, a smooth ball and a textured floor."""
    walls = room()
    ball = sphere(0.4, 2, (0.6, 0.7, 0.2))
    floor = plane(0.9, -0.98)
    both = build(
        *[_get_mesh(walls)],
        replace(ball, positions=ball.positions + np.array([0.5, -0.7, 0.4])),
        floor,
        camera=walls.camera,
        spotlight=walls.spotlight,
    )
    uvs = np.zeros((len(both.geometry.positions), 2))
    uvs[-4:] = [[0, 0], [3, 0], [3, 3], [0, 3]]
    return textured(both, [[[250, 30, 30], [30, 250, 30]], [[90, 90, 250], [200, 200, 200]]], uvs)


def _get_mesh(scene):
    from small_scenes import Mesh

    return Mesh(scene.geometry.positions, scene.geometry.faces, (0.5, 0.4, 0.3))


# Right in the mean


@pytest.mark.parametrize("clamp", [0.02, 0.1, 10.0])
@pytest.mark.slow
def test_it_is_what_the_clamp_takes(clamp):
    """Also where c is larger than the scene."""
    scene = make_patterned_room()
    expected, error = trace_lost_light(scene, clamp=clamp)
    found = np.mean([trace_near_light(scene, clamp=clamp, seed=seed) for seed in range(4)], axis=0)
    assert expected.mean() > 0
    np.testing.assert_allclose(found.mean(axis=(0, 1)), expected.mean(axis=(0, 1)), atol=4 * error.max(), rtol=0.01)


@pytest.mark.slow
def test_clamped_vpls_and_the_near_field_are_one_bounce():
    scene, clamp = room(), 0.1
    tracer = Tracer(scene)
    _, hits = find_seen(scene, tracer)
    vpls = cast(scene.emitters, tracer, 2048, "sobol")
    limits = VplLimits(clamp * scene.geometry.diagonal)
    clamped = sum_radiance(tracer, hits, vpls, limits).reshape(SIZE[1], SIZE[0], 3)
    found = clamped + trace_near_light(scene, clamp=clamp)
    truth = PathTracer(scene, tracer).estimate(SIZE, 256, seed=3)
    error = np.sqrt(truth.variance.sum(axis=(0, 1))) / truth.hit.size
    assert clamped.mean() < 0.98 * truth.indirect.mean()
    np.testing.assert_allclose(
        found.mean(axis=(0, 1)), truth.indirect.mean(axis=(0, 1)), atol=4 * error.max(), rtol=3e-3
    )
    blocks = [image.reshape(8, 4, 12, 4, 3).mean(axis=(1, 3)) for image in (found, truth.indirect)]
    np.testing.assert_allclose(*blocks, rtol=0.2, atol=0.1 * truth.indirect.mean())  # and everywhere, not just in all


@pytest.mark.slow
def test_further_bounces_lose_nothing_either():
    scene = make_patterned_room()
    expected, error = trace_lost_light(scene, clamp=0.2, bounces=3)
    once, _ = trace_lost_light(scene, clamp=0.2)
    found = np.mean([trace_near_light(scene, clamp=0.2, bounces=3, seed=seed) for seed in range(4)], axis=0)
    assert expected.mean() > 1.1 * once.mean()
    np.testing.assert_allclose(found.mean(axis=(0, 1)), expected.mean(axis=(0, 1)), atol=4 * error.max(), rtol=0.015)


@pytest.mark.slow
def test_a_disc_light_is_asked_at_its_points():
    scene = room()
    scene = replace(scene, lights=(replace(scene.spotlight, position=(-0.4, 0.3, 0.3), radius=0.4),))
    expected, error = trace_lost_light(scene, clamp=0.2)
    found = np.mean([trace_near_light(scene, clamp=0.2, seed=seed) for seed in range(4)], axis=0)
    np.testing.assert_allclose(found.mean(axis=(0, 1)), expected.mean(axis=(0, 1)), atol=4 * error.max(), rtol=0.015)


@pytest.mark.slow
def test_light_outside_a_vpls_cone_is_restored_as_far_as_the_rays_reach():
    scene = room()
    expected, error = trace_lost_light(scene, clamp=10.0, fov=120.0)
    found = np.mean([trace_near_light(scene, clamp=10.0, fov=120.0, seed=seed) for seed in range(4)], axis=0)
    np.testing.assert_allclose(found.mean(axis=(0, 1)), expected.mean(axis=(0, 1)), atol=4 * error.max(), rtol=0.01)


def test_beside_a_wall_it_is_the_integral_over_the_wall():
    """Points of a floor at 2 to 12 cm from a lit wall, against a sum over the wall."""
    light = Spotlight((1.0, 0.6, 0.0), (0.0, 0.2, 0.0), 90.0, (2.0, 3.0, 4.0))
    wall = quad((0, 0, 1), (0, 0, -1), (0, 1, -1), (0.5, 0.25, 0.75))
    scene = build(wall, plane(1.0, 0.0, (0, 0, 0)), spotlight=light)
    c, n = 0.15, 400
    y, z = np.meshgrid((np.arange(n) + 0.5) / n * c, ((np.arange(2 * n) + 0.5) / n - 1) * c, indexing="ij")
    at = np.stack([np.zeros_like(y), y, z], axis=-1)
    to = np.array(light.position) - at
    distance = np.linalg.norm(to, axis=-1)
    cosine = -(to / distance[..., None]) @ light.axis
    irradiance = cosine * light.cone(-to / distance[..., None]) * to[..., 0] / distance**3
    for x in (0.02, 0.06, 0.12):
        way = at - np.array([x, 0, 0])
        square = (way**2).sum(axis=-1)
        kernel = way[..., 1] * x / square**2 * np.maximum(1 - square / c**2, 0)
        expected = (irradiance * kernel).sum() * (c / n) ** 2 / np.pi * np.multiply(light.emission, (0.5, 0.25, 0.75))
        count = 64 * 64
        seen = Surfaces(
            np.arange(count),
            np.tile(np.array([x, 0, 0], np.float32), (count, 1)),
            *[np.tile(np.array([0, 1, 0], np.float32), (count, 1))] * 2,
        )
        image = trace_residual(PixelJob(Tracer(scene), seen, (64, 64), 4), VplLimits(c), samples=16)
        np.testing.assert_allclose(image[..., :3].mean(axis=(0, 1)), expected, rtol=0.01)


# The same in any unit, on any number of threads, for any number of rays


@pytest.mark.parametrize("factor", [1e-3, 1e3])
def test_the_unit_of_length_does_not_matter(factor):
    one, other = (trace_near_light(scene, clamp=0.1, samples=4) for scene in (room(), scaled(room(), factor)))
    same = np.isclose(other, one, rtol=1e-3, atol=1e-3 * one.mean())
    assert same.mean() > 0.999  # a ray may pass an edge on the other side
    assert other.mean() == pytest.approx(one.mean(), rel=1e-3)


def test_a_seed_is_an_image_whatever_the_threads():
    images = [
        trace_near_light(room(), clamp=0.1, threads=threads, seed=seed) for threads, seed in ((1, 5), (3, 5), (1, 6))
    ]
    np.testing.assert_array_equal(images[0], images[1])
    assert (images[0] != images[2]).any()


@pytest.mark.parametrize("samples", [0.25, 0.5, 1.0, 2.0, 3.0, 8.0])
@pytest.mark.slow
def test_any_number_of_rays_has_the_same_mean(samples):
    scene = room()
    expected = np.mean([trace_near_light(scene, clamp=0.2, seed=seed).mean() for seed in range(4)])
    seeds = int(max(48 / samples, 12))
    means = [trace_near_light(scene, clamp=0.2, samples=samples, seed=10 + seed).mean() for seed in range(seeds)]
    error = np.std(means) / seeds**0.5
    assert error < 0.02 * expected
    assert np.mean(means) == pytest.approx(expected, abs=4 * error + 0.005 * expected)


# The pattern


def test_a_block_errs_less_than_independent_rays_would():
    scene = room()
    images = np.array([trace_near_light(scene, clamp=0.3, samples=1, seed=seed).mean(axis=2) for seed in range(24)])
    alone = images.var(axis=0, ddof=1)
    windows = sum(images[:, i : i + 29, j : j + 45] for i in range(4) for j in range(4)) / 16
    independent = sum(alone[i : i + 29, j : j + 45] for i in range(4) for j in range(4)) / 256
    assert windows.var(axis=0, ddof=1).mean() < 0.6 * independent.mean()


@pytest.mark.parametrize("samples", [0.25, 1.0, 4.0])
def test_weights_of_a_window_add_up_to_its_pixels(samples):
    scene = room()
    tracer = Tracer(scene)
    seen, _ = find_seen(scene, tracer)
    image = trace_residual(PixelJob(tracer, seen, SIZE, 4), VplLimits(0.2), samples=samples)
    for y, x in ((0, 0), (3, 5), (28, 44)):
        assert image[y : y + 4, x : x + 4, 3].mean() == 1


# Hard cases


def test_the_background_and_no_clamp_have_no_residual():
    ball = build(sphere(0.5), plane(0.6, -0.5), camera=Camera((0.0, 0.5, 3.0), (0.0, 0.0, 0.0)))
    tracer = Tracer(ball)
    seen, hits = find_seen(ball, tracer)
    image = trace_residual(PixelJob(tracer, seen, SIZE, 4), VplLimits(0.5), samples=4)
    np.testing.assert_array_equal(image[..., 3] > 0, hits.hit.reshape(SIZE[1], SIZE[0]))
    assert (image[~hits.hit.reshape(SIZE[1], SIZE[0])] == 0).all()
    assert image[..., :3].max() > 0
    assert not trace_residual(PixelJob(tracer, seen, SIZE, 4), VplLimits(0.0), samples=4).any()
    nothing = Surfaces(np.zeros(0, int), *[np.zeros((0, 3), np.float32)] * 3)
    assert not trace_residual(PixelJob(tracer, nothing, SIZE, 4), VplLimits(0.5), samples=0.25).any()


def test_where_no_ray_meets_anything_further_bounces_bring_nothing():
    floor = build(plane(), camera=Camera((0.0, 2.0, 0.1), (0.0, 0.0, 0.0)))
    tracer = Tracer(floor)
    seen, _ = find_seen(floor, tracer)
    image = trace_residual(PixelJob(tracer, seen, SIZE, 4), VplLimits(0.5), samples=1, bounces=3)
    assert (image[..., 3] == 1).any()
    assert (image[..., :3] == 0).all()


def test_faces_twice_at_the_same_place_change_nothing():
    scene = room()
    geometry = scene.geometry
    slivers = np.array([[0, 1, 1], [2, 3, 2]], np.int32)
    twice = replace(
        geometry,
        faces=np.concatenate([geometry.faces, geometry.faces[:, [1, 2, 0]], slivers]),
        face_materials=np.concatenate([geometry.face_materials, geometry.face_materials, [0, 0]]),
    )
    one, other = (trace_near_light(s, clamp=0.1, samples=4) for s in (scene, replace(scene, geometry=twice)))
    assert np.isclose(other, one, rtol=1e-4, atol=1e-4 * one.mean()).mean() > 0.999


def test_no_light_comes_from_behind_the_face():
    """A shading normal that leans over sends rays into its own face, and under that lies a lit floor."""
    light = Spotlight((0.0, -0.5, 0.0), (0.0, -1.0, 0.0), 120.0, (1.0, 1.0, 1.0))
    scene = build(plane(1.0, -0.6), spotlight=light)
    tilted = np.array([0.8, 0.6, 0.0], np.float32)
    up = np.array([0, 1, 0], np.float32)
    seen = Surfaces(np.arange(256), np.zeros((256, 3), np.float32), *(np.tile(n, (256, 1)) for n in (up, tilted)))
    image = trace_residual(PixelJob(Tracer(scene), seen, (16, 16), 4), VplLimits(5.0), samples=16)
    assert not image[..., :3].any()


# Against OpenGL


GRAPH = """extends = "deferred"
[outputs]
residual = "near_field.residual"
[passes.near_field]
inputs = { vpls = "vpl.vpls", depth = "gbuffer.depth", normals = "gbuffer.normals" }
"""


def write_graph(folder, more=""):
    path = folder / "near.toml"
    path.write_text(GRAPH + more, encoding="utf-8")
    return path


@pytest.mark.parametrize("scene", [room(), build(sphere(0.5), camera=Camera((0.0, 0.5, 3.0), (0.0, 0.0, 0.0)))])
def test_the_g_buffer_gives_the_surfaces_that_rays_find(renderer, tmp_path, scene):
    one = renderer(SIZE, write_graph(tmp_path))
    one.draw(scene, one.plan(scene, 1))
    with one.gpu.ctx:
        depth, normals = (one.executor.resource(("gbuffer", port)).read() for port in ("depth", "normals"))
    near = NEAR * scene.geometry.diagonal
    found = decode_gbuffer(scene.camera, near, depth[..., 0], normals)
    expected, _ = find_seen(scene, one.tracer())
    flipped = (SIZE[1] - 1 - found.pixel // SIZE[0]) * SIZE[0] + found.pixel % SIZE[0]
    common, mine, theirs = np.intersect1d(flipped, expected.pixel, return_indices=True)
    assert len(common) >= 0.99 * max(len(expected.pixel), len(found.pixel)) > 0
    close = np.abs(found.position[mine] - expected.position[theirs]).max(axis=1) < 1e-4
    assert close.mean() > 0.99
    for name in ("normal", "shading_normal"):
        off = np.abs(getattr(found, name)[mine] - getattr(expected, name)[theirs]).max(axis=1)
        assert (off[close] < 1e-3).mean() > 0.99


def test_the_pass_makes_the_image_of_the_core(renderer, tmp_path):
    scene = room()
    one = renderer(SIZE, write_graph(tmp_path), set={"vpl.clamp": 0.1, "vpl.fov": 179.9, "near_field.samples": 16})
    plan = one.plan(scene, 16)
    one.draw(scene, plan, seed=3)
    with one.gpu.ctx:
        image = one.executor.resource(("near_field", "residual")).read()[::-1]
    assert np.isfinite(image).all()
    assert (image[..., 3] == 1).all()
    _, hits = find_seen(scene, one.tracer())
    found = image[..., :3] * hits.albedo.reshape(SIZE[1], SIZE[0], 3) / np.pi
    assert found.mean() == pytest.approx(trace_near_light(scene, clamp=0.1).mean(), rel=0.05)


def test_it_reads_bounces_and_cone_from_the_lights(renderer, tmp_path):
    scene, means = room(), []
    for settings in ({}, {"vpl.bounces": 3}, {"vpl.fov": 90.0}):
        one = renderer(SIZE, write_graph(tmp_path), set={"vpl.clamp": 0.2, "vpl.fov": 179.9, **settings})
        one.draw(scene, one.plan(scene, 16))
        with one.gpu.ctx:
            means.append(one.executor.resource(("near_field", "residual")).read()[..., :3].mean())
    assert means[1] > 1.1 * means[0]
    assert means[2] > 1.1 * means[0]


@pytest.mark.parametrize("setting", ["vpl.clamp", "vpl.count"])
def test_where_nothing_is_clamped_it_is_left_out_and_says_why(setting, renderer, tmp_path):
    one = renderer(SIZE, write_graph(tmp_path), set={setting: 0})
    scene = room()
    assert one.plan(scene, outputs=["radiance"]).left_out["near_field"].startswith("nothing is clamped: vpl.clamp")
    dark = replace(scene, lights=(replace(scene.spotlight, emission=(0.0, 0.0, 0.0)),))
    assert "nothing shines" in one.plan(dark, outputs=["radiance"]).left_out["near_field"]


@pytest.mark.parametrize(("n", "off"), [(1, 0.01), (4, 0.02)])
def test_the_graph_accurate_is_one_bounce_of_light(renderer, n, off):
    """The tolerance is larger with interleaving: in so small an image, many filter windows are cut by edges."""
    scene, size = room(), (96, 64)
    one = renderer(size, "mapped", set={"vpl.clamp": 0.1, "interleave.n": n})
    image = one.render(scene, vpls=512).radiance
    truth = PathTracer(scene, one.tracer()).estimate(size, 128, seed=3)
    indirect = (image - truth.direct)[truth.hit].mean() / truth.indirect[truth.hit].mean()
    assert indirect == pytest.approx(1, abs=off)
    clamped = renderer(size, "hemisphere", set={"vpl.clamp": 0.1})
    less = (clamped.render(scene, vpls=512).radiance - truth.direct)[truth.hit].mean()
    assert less < 0.98 * truth.indirect[truth.hit].mean()


def test_the_graph_accurate_clamps_the_more_the_fewer_vpls_there_are(renderer):
    scene, distances = room(), []
    one = renderer(SIZE, "mapped")
    for vpls in (16, 64):
        one.draw(scene, one.plan(scene, vpls))
        records = one.executor.resource(("vpl", "vpls")).records
        distances.append(records["clamp_squared"][1] ** 0.5 / scene.geometry.diagonal)
    np.testing.assert_allclose(distances, [0.16, 0.08], rtol=1e-5)
