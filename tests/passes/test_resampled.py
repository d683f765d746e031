"""The graph `resampled`: its mean is that of the whole pool, and its samples stay on their own surfaces."""

from dataclasses import replace

import numpy as np
import pytest
from distance import assert_same_but_for_edges, rel_mse, same_pixels
from small_scenes import build, crooked_room, plane, quad, room, smooth_scene, sphere, two_rooms

from deferred_ir.base.errors import GraphError
from deferred_ir.frame.frame import NEAR
from deferred_ir.frame.vpl_buffer import read_limits, read_vpls
from deferred_ir.pool.layout import LONELY, Layout
from deferred_ir.rays.pixel_surfaces import decode_gbuffer
from deferred_ir.rays.tracer import Tracer
from deferred_ir.scene.camera import Camera
from deferred_ir.truth.path_tracer import PathTracer
from deferred_ir.vpls.ray_sum import sum_radiance

RAW = {"sample_pixels.scale": 1, "filter_samples.steps": 0, "near_field.samples": 1.0}
FEW = {"list_vpls.entries": 64, "choose_vpls.draws": 16}


def read_port(one, port):
    with one.gpu.ctx:
        return one.executor.resource(tuple(port.split("."))).read()


def read_records(one):
    return one.executor.resource(("vpl", "vpls")).records


@pytest.mark.parametrize(
    ("scene", "rays"),
    [(room(), 1), (smooth_scene(), 4), (two_rooms(), 4), (room(), 8)],
    ids=["room, one ray", "smooth", "two rooms", "room, eight rays"],
)
def test_the_mean_is_that_of_all_vpls_of_the_pool(renderer, tmp_path, scene, rays):
    """Each image against the sum over its own pool, which takes most of the noise away; the near field is left out."""
    settings = {**RAW, **FEW, "choose_vpls.rays": rays, "vpl.candidates": 8, "vpl.clamp": 0.05, "vpl.fov": 150.0}
    graph, size = tmp_path / "graph.toml", (16, 12)
    graph.write_text(
        'extends = "resampled"\n[outputs]\nnear_field = "near_field.residual"\nraw = "light_samples.irradiance"\n'
    )
    one = renderer(size, graph, set=settings)
    tracer, off, full = Tracer(scene), [], []
    hits = PathTracer(scene, tracer).trace_camera_rays(size)
    for seed in range(160):
        one.draw(scene, one.plan(scene, 16, ["radiance", "near_field", "raw"]), seed=seed)
        records = read_records(one)
        irradiance = read_port(one, "light_samples.irradiance") - read_port(one, "near_field.residual")
        expected = sum_radiance(tracer, hits, read_vpls(records), read_limits(records)).reshape(12, 16, 3)[::-1]
        albedo = read_port(one, "gbuffer.albedo")[..., :3]
        off.append(irradiance[..., :3] * albedo / np.pi - expected)
        full.append(expected)
    off, mean = np.array(off), np.mean(full, axis=0)
    error = off.std(axis=0) / np.sqrt(len(off))
    beyond = np.abs(off.mean(axis=0)) > 4.5 * error + 1e-3 * mean.mean()
    assert beyond.mean() < 6e-3  # light that is rarely drawn, and hard shadows that a rounding moves
    whole = off.mean(axis=(1, 2, 3)) / mean.mean()
    assert abs(whole.mean()) < 4 * whole.std() / np.sqrt(len(whole)) + 1e-4
    assert whole.std() / np.sqrt(len(whole)) < 0.015


@pytest.mark.parametrize("vpls", [1, 40, 3000])
def test_lists_hold_each_vpl_as_often_as_its_weight_says(renderer, vpls):
    """The groups of a list are drawn systematically, by their chances; the sum over a list is the pool's."""
    one = renderer((32, 24), "resampled", set={"vpl.candidates": 1, "list_vpls.entries": 64})
    sums, features = [], np.random.default_rng(0).random(vpls)
    for seed in range(12):
        one.render(room(), vpls=vpls, seed=seed)
        records = read_records(one)
        count, groups = len(records), min(len(records), 1024)
        numbers = read_port(one, "list_vpls.numbers")[..., 0].astype(int)
        pool = read_port(one, "vpl.pool").reshape(-1, 3, 4)[:count]
        assert (numbers < count).all()
        assert (np.diff(numbers, axis=1) >= -(count // groups)).all()  # along the curve, group by group
        listed = read_port(one, "list_vpls.list_positions")
        np.testing.assert_array_equal(listed[..., :3], pool[numbers, 0, :3])
        np.testing.assert_array_equal(read_port(one, "list_vpls.list_normals"), pool[numbers, 1])
        weight = listed[..., 3] / pool[numbers, 0, 3]
        np.testing.assert_allclose(
            read_port(one, "list_vpls.list_emissions")[..., :3], weight[..., None] * pool[numbers, 2, :3], rtol=1e-5
        )
        chances = np.diff(read_port(one, "propose_vpls.chances")[:, :groups, 0].astype(float), axis=1, prepend=0)
        group = np.searchsorted(np.arange(groups + 1) * count // groups, numbers, side="right") - 1
        drawn = np.stack([np.bincount(row, minlength=groups) for row in group])
        assert np.abs(drawn - 64 * chances).max() < 1 + 1e-3
        sums.append((weight * features[numbers]).sum(axis=1) / features[:count].sum())
    sums = np.array(sums)
    error = sums.mean(axis=1).std() / np.sqrt(len(sums))
    assert abs(sums.mean() - 1) < 4.5 * error + 1e-5


def test_it_shows_what_accurate_shows(renderer):
    """Two ways to one image, averaged over seeds; without filter and at every pixel."""
    scene, size = room(), (32, 24)
    one = renderer(size, "resampled", set=RAW)
    other = renderer(size, "mapped", set={"interleave.n": 1, "vpl.candidates": 1, "shadow_rays.visibility": "rays"})
    means = [
        np.mean([made.render(scene, vpls=64, seed=seed).radiance for seed in range(16)], axis=0)
        for made in (one, other)
    ]
    assert means[0].mean() == pytest.approx(means[1].mean(), rel=0.004)
    assert rel_mse(*means, np.ones(size[::-1], bool), trim=0.01) < 0.003


@pytest.mark.parametrize("scene", [room(), smooth_scene()], ids=["room", "smooth"])
def test_direct_light_is_that_of_rays(renderer, scene):
    one, other = renderer((64, 48), "resampled"), renderer((64, 48), "mapped", set={"shadow_rays.visibility": "rays"})
    assert_same_but_for_edges(*(made.render(scene, vpls=0).radiance for made in (one, other)))
    soft = replace(scene, lights=(replace(scene.spotlight, radius=0.1),))
    means = [np.mean([made.render(soft, vpls=0, seed=s).radiance for s in range(8)], axis=0) for made in (one, other)]
    assert rel_mse(*means, np.ones((48, 64), bool)) < 1e-3


FENCE = build(
    plane(3.0),
    *(quad((x, 0.0, 0.4), (x + 0.03, 0.0, 0.4), (x + 0.03, 0.8, 0.4)) for x in np.linspace(-1, 1, 12)),
    sphere(0.3),
    camera=Camera((0.0, 1.0, 3.0), (0.0, 0.3, 0.0), fov=45.0),
)


@pytest.mark.parametrize("scale", [2, 3, 4])
@pytest.mark.parametrize("size", [(50, 37), (5, 3), (1, 1)])
@pytest.mark.parametrize("scene", [FENCE, crooked_room()], ids=["fence", "room"])
def test_pixels_take_light_of_their_own_surface_only(renderer, scene, size, scale):
    """What `blend` says of a pixel, by the definition."""
    one = renderer(size, "resampled", set={"sample_pixels.scale": scale})
    one.render(scene, vpls=4, seed=3)
    blend, layout = read_port(one, "sample_pixels.blend")[..., 0], Layout.of_frame(size, scale, 3)
    depth, normals = read_port(one, "gbuffer.depth")[..., 0], read_port(one, "gbuffer.normals")
    seen = decode_gbuffer(scene.camera, NEAR * scene.geometry.scale, depth, normals)
    rows = np.full(size[0] * size[1], -1)
    rows[seen.pixel] = np.arange(len(seen.pixel))
    grid, listed = layout.find_grid_pixels(), []
    step = 2 * np.tan(np.radians(scene.camera.fov) / 2) / size[1] * scale
    distance = NEAR * scene.geometry.scale / np.maximum(depth, 1e-30)
    for y, x in np.ndindex(*blend.shape):
        here = rows[y * size[0] + x]
        if here < 0:
            assert blend[y, x] == 0
            continue
        left, low = ((to - off) // scale for to, off in zip((x, y), layout.offset, strict=True))
        shares, doubt = [], False
        for i in range(4):
            at = grid[np.clip(low + i // 2, 0, len(grid) - 1), np.clip(left + i % 2, 0, len(grid[0]) - 1)]
            other, same = rows[at], False
            if other >= 0:
                height = abs(seen.normal[here] @ (seen.position[other] - seen.position[here]))
                cosine = seen.shading_normal[here] @ seen.shading_normal[other]
                same = height <= 0.5 * step * distance[y, x] and cosine >= np.cos(np.radians(25))
                doubt |= abs(height / (0.5 * step * distance[y, x]) - 1) < 1e-3 or abs(cosine - 0.9063) < 1e-4
            shares.append(same)
        if doubt:
            continue
        found = [bool(blend[y, x] >> 7 * i & 127) for i in range(4)] if not blend[y, x] & LONELY else [False] * 4
        assert found == shares
        if blend[y, x] & LONELY:
            listed.append(y * size[0] + x)
    pixels = read_port(one, "sample_pixels.pixels").ravel()
    places = blend[(blend & LONELY) != 0] & ~np.uint32(LONELY)
    assert set(listed) <= set(pixels[places].tolist())
    assert (pixels[places] == np.flatnonzero(blend & LONELY)).all()


@pytest.mark.parametrize("scale", [2, 4])
def test_no_light_crosses_an_edge(renderer, scale):
    """The light falls upon the floor, whose VPLs light the ceiling and the ball but not the back of the fence."""
    wall = quad((-2, -2, 1.5), (2, -2, 1.5), (2, -0.4, 1.5))
    scene = build(
        plane(2.0, -1.0),
        wall,
        camera=Camera((0.0, 0.8, 4.0), (0.0, -0.5, 0.0), fov=50.0),
        spotlight=replace(room().spotlight, position=(0.0, 1.5, 0.0), look_at=(0.0, -1.0, 0.0), fov=60.0),
    )
    full, few = (
        renderer((96, 80), "resampled", set={"sample_pixels.scale": s}).render(scene, vpls=16).radiance
        for s in (1, scale)
    )
    dark = full.max(axis=-1) == 0
    assert 0.5 < dark.mean() < 0.98
    assert few[dark].max() == 0


def test_filter_keeps_constant_light(renderer):
    """Far above a plane the light of few VPLs is even, and so it stays, to the edge of the frame."""
    scene = build(
        plane(1.0, 0.0),
        plane(2.0, 40.0),
        camera=Camera((0.0, 3.0, 0.001), (0.0, 0.0, 0.0), fov=30.0),
        spotlight=replace(room().spotlight, position=(0.0, 20.0, 0.0), look_at=(0.0, 60.0, 0.0), fov=10.0),
    )
    one = renderer((40, 32), "resampled", set={"vpl.pattern": "stratified"})
    image = one.render(scene, vpls=16).radiance
    assert image.min() > 0
    np.testing.assert_allclose(image, np.broadcast_to(image.mean(axis=(0, 1)), image.shape), rtol=0.02)


def test_the_filter_takes_most_of_the_noise_and_none_of_the_light(renderer):
    scene, size = room(), (96, 72)
    raw, filtered = (renderer(size, "resampled", set={**RAW, "filter_samples.steps": steps}) for steps in (0, 3))
    truth = renderer(size, "mapped", set={"interleave.n": 1}).render(scene, vpls=256, seed=5).radiance
    everywhere = np.ones(size[::-1], bool)
    errors = [
        np.mean([rel_mse(made.render(scene, vpls=64, seed=seed).radiance, truth, everywhere) for seed in range(4)])
        for made in (raw, filtered)
    ]
    assert errors[1] < 0.4 * errors[0]
    means = [
        np.mean([made.render(scene, vpls=64, seed=seed).radiance.mean() for seed in range(8)])
        for made in (raw, filtered)
    ]
    assert means[1] == pytest.approx(means[0], rel=0.01)


def test_a_seed_is_an_image(renderer):
    first, second = (renderer((40, 30), "resampled").render(FENCE, vpls=16, seed=7) for _ in range(2))
    assert same_pixels(first, second)
    assert not same_pixels(first, renderer((40, 30), "resampled").render(FENCE, vpls=16, seed=8))


@pytest.mark.parametrize(
    ("settings", "told"), [({"draws": 30, "rays": 4}, "must divide"), ({"draws": 24}, "try rays 4, draws 32")]
)
def test_draws_that_do_not_fit_are_refused(renderer, settings, told):
    with pytest.raises(GraphError, match=told):
        renderer((8, 8), "resampled", set={f"choose_vpls.{k}": v for k, v in settings.items()}).plan(room())


def test_figures_tell_samples_and_rays(renderer):
    one = renderer((40, 30), "resampled")
    one.render(FENCE, vpls=16)
    samples, rays = one.executor.counters["samples"], one.executor.counters["choice_rays"]
    assert 300 < samples <= 1200
    assert 0 < rays <= 4 * samples


def views(scene):
    """Scenes and options of frames that follow each other: each changes one thing."""
    light, camera = scene.spotlight, scene.camera
    yield scene, {}
    yield replace(scene, camera=replace(camera, fov=camera.fov - 5)), {}
    yield replace(scene, lights=(replace(light, emission=(3.0, 2.0, 1.0)),)), {}
    yield replace(scene, lights=(replace(light, emission=(3.0, 2.0, 1.0)),)), {"seed": 2}
    yield replace(scene, lights=(replace(light, position=(0.1, 0.8, 0.2)),)), {"seed": 2}
    yield replace(scene, lights=(replace(light, emission=(0.0, 0.0, 0.0)),)), {}
    yield build(plane()), {}
    yield scene, {}


def test_reused_frames_are_those_drawn_anew(renderer):
    settings = {"vpl.count": 8}
    one, other = (renderer((32, 24), "resampled", set=settings, reuse=reuse) for reuse in (True, False))
    for scene, options in views(room()):
        assert same_pixels(one.render(scene, **options), other.render(scene, **options))


def test_a_still_frame_runs_nothing(renderer):
    one, scene = renderer((32, 24), "resampled", set={"vpl.count": 8}, reuse=True), room()
    plan = one.plan(scene)
    one.draw(scene, plan)
    assert not one.executor.skipped
    one.draw(scene, plan)
    assert set(one.executor.skipped) == {step.name for step in plan.steps}


def test_a_filters_slider_casts_nothing_and_asks_no_ray(renderer):
    one, scene = renderer((32, 24), "resampled", set={"vpl.count": 8}, reuse=True), room()
    one.draw(scene, one.plan(scene))
    one.configure(set={"vpl.count": 8, "filter_samples.tolerance": 2.0})
    plan = one.plan(scene)
    one.draw(scene, plan)
    ran = {step.name for step in plan.steps} - set(one.executor.skipped)
    assert ran == {"filter_samples", "lighting", "tonemap"}


def test_what_a_scene_does_not_need_is_left_out(renderer):
    one, full = renderer((32, 24), "resampled"), renderer((32, 24), "resampled", keep_all=True)
    assert {step.name for step in one.plan(room(), 0, ["radiance", "display"]).steps} == {
        *("lights", "vpl", "gbuffer", "direct_rays", "lighting", "tonemap")
    }
    assert same_pixels(one.render(room(), vpls=0), full.render(room(), vpls=0))
    dark = replace(room(), lights=(replace(room().spotlight, emission=(0.0, 0.0, 0.0)),))
    assert "direct_rays" in one.plan(dark, 4).left_out
    assert not one.render(dark, vpls=4).radiance.any()
    assert same_pixels(one.render(room(), vpls=4), full.render(room(), vpls=4))


@pytest.mark.parametrize("angle", ["sample_pixels.angle", "filter_samples.angle"])
def test_a_sample_is_on_its_own_surface_however_narrow_the_angle(renderer, angle):
    """A rounded normal's cosine to itself may be below 1."""
    image = renderer((40, 30), "resampled", set={angle: 0.0}).render(smooth_scene(), vpls=8).radiance
    assert np.isfinite(image).all()
    assert image.max() > 0
