"""VPLs' shadows by rays in the graph: pixel by pixel what the reference says, and chosen where they cost less."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from distance import rel_mse, share_off
from small_scenes import crooked_room, room, smooth_scene

from deferred_ir.frame.facts import EMITS
from deferred_ir.graph.compile import compile
from deferred_ir.graph.facts import Facts
from deferred_ir.graph.file import load_graph
from deferred_ir.truth.path_tracer import PathTracer
from deferred_ir.vpls.cast import Vpls, cast
from deferred_ir.vpls.interleaving import deal, find_places, find_share_starts, find_sub_buffers
from deferred_ir.vpls.kernel import VplLimits
from deferred_ir.vpls.ray_sum import sum_radiance

SIZE = (50, 38)  # no multiple of 4
RAYS = {"shadow_rays.visibility": "rays", "vpl.clamp": 0.02, "vpl.candidates": 1}


def drawn(renderer, scene, vpls, **settings):
    """A Renderer that has drawn one frame of `accurate` by rays, and its plan."""
    one = renderer(SIZE, "mapped", set=RAYS | settings, keep_all=True)
    plan = one.plan(scene, vpls)
    one.draw(scene, plan)
    return one, plan


def read(one, source):
    with one.gpu.ctx:
        return one.executor.resource(source).read()


def irradiance(tracer, hits, vpls, clamp=0.02):
    """Of all VPLs by the reference, (n, 3)."""
    white = replace(hits, albedo=np.full(hits.albedo.shape, np.pi))
    limits = VplLimits.from_angle(179.9, clamp * tracer.scene.geometry.diagonal)
    return sum_radiance(tracer, white, vpls, limits)


@pytest.mark.parametrize(("n", "count"), [(4, 45), (2, 500)])
def test_sub_buffers_hold_what_the_reference_finds_for_each_share(renderer, n, count):
    """Also with more VPLs in a share than a word of the masks or a block of lights has."""
    scene = crooked_room()
    one, _ = drawn(renderer, scene, count, **{"interleave.n": n, "near_field.samples": 0.25})
    found = read(one, ("light_shares", "shares"))[..., :3].reshape(-1, 3)
    residual = read(one, ("near_field", "residual"))[..., :3].reshape(-1, 3)
    tracer = one.tracer()
    hits = PathTracer(scene, tracer).trace_camera_rays(SIZE)
    pixel = np.arange(SIZE[0] * SIZE[1])
    hits = hits.rows((SIZE[1] - 1 - pixel // SIZE[0]) * SIZE[0] + pixel % SIZE[0])  # bottom row first
    vpls = cast(scene.emitters, tracer, count, "sobol")
    order, starts = deal(np.arange(len(vpls)), count), find_share_starts(len(vpls), n)
    share, place = find_places(pixel, SIZE, n)
    expected = np.zeros((len(pixel), 3))
    for s in range(n * n):
        rows, lights = np.flatnonzero(share == s), order[starts[s] : starts[s + 1]]
        part = Vpls(vpls.position[lights], vpls.normal[lights], vpls.emission[lights], lights)
        expected[rows] = n * n * irradiance(tracer, hits.rows(rows), part)
    everywhere = np.ones(len(pixel), bool)
    assert share_off(found[place] - residual, expected, everywhere) < 0.01
    assert found.mean() > 0


def test_places_are_those_of_the_sub_buffers():
    pixel = np.arange(SIZE[0] * SIZE[1])
    share, place = find_places(pixel, SIZE, 4)
    np.testing.assert_array_equal(np.sort(place), pixel)
    for s, (x, y, width, height) in enumerate(find_sub_buffers(SIZE, 4)):
        row, column = np.divmod(place[share == s], SIZE[0])
        assert (row.min(), row.max(), column.min(), column.max()) == (y, y + height - 1, x, x + width - 1)


def test_lonely_pixels_ask_the_missing_vpls(renderer):
    """Where no neighbour counts every pixel is lonely, and the picture is the reference's."""
    scene = crooked_room()
    one, _ = drawn(renderer, scene, 40, **{"neighbours.fewest": 1.0, "neighbours.angle": 0.0, "vpl.clamp": 0.0})
    known, asked = (
        read(one, source)[::-1, :, :3] for source in (("gather", "irradiance"), ("light_lonely_pixels", "irradiance"))
    )
    image = known + asked
    assert asked.mean() > 0.9 * image.mean()
    hits = PathTracer(scene, one.tracer()).trace_camera_rays(SIZE)
    expected = irradiance(one.tracer(), hits, cast(scene.emitters, one.tracer(), 40, "sobol"), clamp=0.0)
    assert share_off(image, expected.reshape(image.shape), np.ones(image.shape[:2], bool)) < 0.01


def test_rays_and_maps_make_the_same_picture(renderer):
    scene = crooked_room()
    by_rays, plan = drawn(renderer, scene, 64)
    by_maps = renderer(SIZE, "mapped", set=RAYS | {"shadow_rays.visibility": "maps"})
    rays, maps = by_rays.read(plan).radiance, by_maps.render(scene, vpls=64).radiance
    assert rays.mean() == pytest.approx(maps.mean(), rel=0.01)
    assert np.abs(rays - maps).mean() < 0.03 * maps.mean()


def test_with_rays_no_light_has_a_map(renderer):
    one, plan = drawn(renderer, room(), 64)
    assert plan.left_out["shadow_maps"] == "not needed: shadow_rays replaces it"
    assert one.executor.counters["maps_drawn"] == 0
    maps = renderer(SIZE, "mapped", set={"shadow_rays.visibility": "maps"}).plan(room(), 64)
    assert "shadow_maps" in {step.name for step in maps.steps}
    dealt_to_all = renderer(SIZE, "mapped", set=RAYS | {"interleave.n": 1}).plan(room(), 64)
    assert "shadow_maps" in {step.name for step in dealt_to_all.steps}  # there are no shares to ask about


@pytest.mark.parametrize("radius", [0.0, 0.3])
@pytest.mark.parametrize("scene", [crooked_room(), smooth_scene()])
def test_the_spotlight_is_right_pixel_by_pixel(renderer, scene, radius):
    scene = replace(scene, lights=(replace(scene.spotlight, radius=radius),))
    one = renderer(SIZE, "mapped", set=RAYS | {"shadow_rays.disc_samples": 64})
    found = one.render(scene, vpls=0, accumulate=4 if radius else 1).radiance
    truth = PathTracer(scene, one.tracer()).estimate_direct(SIZE, 256)
    lit = truth.mean(axis=2) > 0
    assert 0.05 < lit.mean() < 0.95
    assert rel_mse(found, truth, np.ones(lit.shape, bool), trim=1e-3) < (1e-3 if radius else 1e-7)
    assert found[lit].mean() == pytest.approx(truth[lit].mean(), rel=2e-3)


@pytest.mark.parametrize("vpls", [0, 1])
def test_few_vpls_are_no_trouble(renderer, vpls):
    one, plan = drawn(renderer, room(), vpls)
    assert np.isfinite(one.read(plan).radiance).all()


def left_out(visibility, facts):
    plan = compile(load_graph("mapped", {"shadow_rays.visibility": visibility}, {}), ["radiance"], Facts(facts))
    return plan.left_out.get("shadow_rays")


def test_where_it_is_left_out_it_says_why():
    assert left_out("rays", {}) is None
    assert left_out("maps", {}) == "visibility is 'maps'"
    assert left_out("rays", {EMITS: False}) == "nothing shines"
