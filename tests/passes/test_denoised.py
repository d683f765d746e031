"""The graph `denoised`: less noise than `resampled`, all of the light, and none of it on another surface."""

from dataclasses import replace

import numpy as np
import pytest
from distance import rel_mse, same_pixels
from small_scenes import build, crooked_room, plane, quad, room

from deferred_ir.pool.denoiser import find_obstacle
from deferred_ir.pool.layout import Layout
from deferred_ir.scene.camera import Camera

pytestmark = pytest.mark.skipif(find_obstacle() is not None, reason="without the extra denoise, which dev includes")

FENCE = build(
    plane(3.0),
    *(quad((x, 0.0, 0.4), (x + 0.03, 0.0, 0.4), (x + 0.03, 0.8, 0.4)) for x in np.linspace(-1, 1, 12)),
    camera=Camera((0.0, 1.0, 3.0), (0.0, 0.3, 0.0), fov=45.0),
)


def read_port(one, port):
    with one.gpu.ctx:
        return one.executor.resource(tuple(port.split("."))).read()


def test_it_errs_less_than_resampled_and_keeps_the_light(renderer):
    scene, size = room(), (96, 72)
    truth = renderer(size, "mapped", set={"interleave.n": 1}).render(scene, vpls=256, seed=5).radiance
    raw = renderer(size, "resampled", set={"filter_samples.steps": 0})
    means, errors = [], []
    for one in (raw, renderer(size, "resampled"), renderer(size, "denoised")):
        images = [one.render(scene, vpls=64, seed=seed).radiance for seed in range(8)]
        errors.append(np.mean([rel_mse(image, truth, np.ones(size[::-1], bool)) for image in images]))
        means.append(np.mean(images))
    assert errors[2] < 0.95 * errors[1] < 0.5 * errors[0]
    assert means[2] == pytest.approx(means[0], rel=0.005)


@pytest.mark.parametrize("scale", [1, 2, 4])
def test_no_light_crosses_an_edge(renderer, scale):
    """The light falls upon the floor, whose VPLs light the ceiling and the ball but not the back of the fence."""
    scene = build(
        plane(2.0, -1.0),
        quad((-2, -2, 1.5), (2, -2, 1.5), (2, -0.4, 1.5)),
        camera=Camera((0.0, 0.8, 4.0), (0.0, -0.5, 0.0), fov=50.0),
        spotlight=replace(room().spotlight, position=(0.0, 1.5, 0.0), look_at=(0.0, -1.0, 0.0), fov=60.0),
    )
    full = renderer((96, 80), "resampled", set={"sample_pixels.scale": 1}).render(scene, vpls=16).radiance
    denoised = renderer((96, 80), "denoised", set={"sample_pixels.scale": scale}).render(scene, vpls=16).radiance
    dark = full.max(axis=-1) == 0
    assert 0.5 < dark.mean() < 0.98
    assert denoised[dark].max() == 0


@pytest.mark.parametrize("size", [(1, 1), (5, 3), (50, 37), (1, 40)])
@pytest.mark.parametrize("scene", [FENCE, crooked_room()], ids=["fence", "room"])
def test_samples_of_the_list_keep_their_filtered_light(renderer, tmp_path, scene, size):
    graph = tmp_path / "graph.toml"
    graph.write_text(
        'extends = "denoised"\n[outputs]\nfiltered = "filter_samples.filtered"\nlight = "denoise_samples.denoised"\n'
    )
    one = renderer(size, graph)
    one.draw(scene, one.plan(scene, 8), seed=3)
    assert np.isfinite(one.read(one.plan(scene, 8)).radiance).all()
    layout = Layout.of_frame(size, 2, 3)
    columns, rows = layout.grid
    listed = read_port(one, "sample_pixels.pixels")[..., 0] != 0xFFFFFFFF
    listed[:rows, :columns] = False
    ports = "filter_samples.filtered", "denoise_samples.denoised"
    filtered, denoised = (read_port(one, port)[..., :3] for port in ports)
    np.testing.assert_array_equal(denoised[listed], filtered[listed])
    inside = read_port(one, "sample_pixels.positions")[:rows, :columns, 3] > 0
    assert size == (1, 1) or (denoised[:rows, :columns][inside] != filtered[:rows, :columns][inside]).any()


def test_a_seed_is_an_image(renderer):
    first, second = (renderer((40, 30), "denoised").render(FENCE, vpls=16, seed=7) for _ in range(2))
    assert same_pixels(first, second)
    assert not same_pixels(first, renderer((40, 30), "denoised").render(FENCE, vpls=16, seed=8))


@pytest.mark.parametrize("factor", [2.0**-60, 2.0**60])
def test_the_unit_of_light_does_not_matter(renderer, factor):
    one, scene = renderer((40, 30), "denoised"), room()
    emission = tuple(factor * value for value in scene.spotlight.emission)
    image = one.render(replace(scene, lights=(replace(scene.spotlight, emission=emission),)), vpls=16).radiance
    np.testing.assert_allclose(image / factor, one.render(scene, vpls=16).radiance, rtol=1e-5, atol=1e-8)


def test_a_change_of_quality_runs_the_denoiser_and_what_follows(renderer):
    one, scene = renderer((32, 24), "denoised", set={"vpl.count": 8}, reuse=True), room()
    balanced = one.render(scene)
    one.configure(set={"vpl.count": 8, "denoise_samples.quality": "fast"})
    plan = one.plan(scene, outputs=["radiance", "display"])
    one.draw(scene, plan)
    ran = {step.name for step in plan.steps} - set(one.executor.skipped)
    assert ran == {"denoise_samples", "lighting", "tonemap"}
    assert not same_pixels(balanced, one.read(plan))


def test_without_vpls_nothing_is_denoised(renderer):
    one = renderer((32, 24), "denoised")
    assert "denoise_samples" in one.plan(room(), 0).left_out
    assert same_pixels(one.render(room(), vpls=0), renderer((32, 24), "resampled").render(room(), vpls=0))
