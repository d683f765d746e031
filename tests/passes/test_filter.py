"""Wide filters of shadow maps: planes stay evenly lit, tiles stay apart, and edges grow as wide as the filter."""

from __future__ import annotations

from dataclasses import replace
from importlib import import_module

import numpy as np
import pytest
from fixed_lights import lit_by, vpl_records
from small_scenes import build, plane, quad, room, scaled

from deferred_ir.scene.camera import Camera
from deferred_ir.scene.lights.spotlight import Spotlight

visibility = import_module("deferred_ir.profiling.checks.visibility")

GRAPHS = ("deferred", "forward")
SIZE = (64, 64)
DARK = (0.0, 0.0, 0.0)


def shown(make, scene, lights, *, size=SIZE, seed=0, **settings):
    """What the maps say of pairs of a pixel and a light, and what rays say: both (n,)."""
    given = {"shadow_maps.spot_size": 128, "shadow_maps.vpl_size": 64} | settings
    one = make(size, visibility.GRAPH, set=given, passes=visibility.PASSES)
    plan = one.plan(scene, outputs=[visibility.name_output(lights)])
    one.draw(scene, plan, seed=seed)
    pairs = visibility.trace_pairs(one, scene, lights)
    return pairs.shown, pairs.lit


@pytest.mark.parametrize("graph", GRAPHS)
def test_without_a_wide_filter_the_number_of_taps_changes_nothing(renderer, graph):
    one, other = (
        renderer(SIZE, graph, set={"shadow_maps.spot_taps": taps, "shadow_maps.vpl_taps": taps}) for taps in (1, 50)
    )
    images = [each.render(room(), vpls=16).radiance for each in (one, other)]
    assert np.array_equal(*images)


@pytest.mark.parametrize("kernel", [3.0, 9.0, 32.0])
@pytest.mark.parametrize("fov", [60.0, 130.0, 170.0])
@pytest.mark.parametrize("tilt", [0.0, 40.0, 75.0, 88.0])
def test_a_plane_in_the_spotlight_is_lit_all_over(renderer, kernel, fov, tilt):
    """Wider than 140 degrees the map is a paraboloid, in which the plane is curved."""
    up, across = np.array([0.0, np.cos(np.radians(tilt)), np.sin(np.radians(tilt))]), np.array([1.0, 0.3, 0.0])
    across -= (across @ up) * up
    floor = 3 * np.array([-across - np.cross(up, across), across - np.cross(up, across), across + np.cross(up, across)])
    scene = build(
        quad(*floor),
        camera=Camera((0.1, 2.0, 0.9), (0.0, 0.0, 0.0), fov=70.0),
        spotlight=Spotlight((0.2, 1.0, 0.3), (0.0, 0.0, 0.0), fov, (1.0, 1.0, 1.0)),
    )
    value, lit = shown(renderer, scene, "spotlight", **{"shadow_maps.spot_kernel": kernel})
    assert len(lit) > 500
    assert lit.mean() > 0.99
    assert value[lit].min() == 1.0


@pytest.mark.parametrize("kernel", [3.0, 16.0])
@pytest.mark.parametrize("projection", ["perspective", "paraboloid"])
@pytest.mark.parametrize("factor", [0.001, 1.0, 1000.0])
def test_between_two_planes_vpls_reach_everything(renderer, kernel, projection, factor):
    tilted = quad((-1, 1.6, -1), (1, 2.0, -1), (1, 1.3, 1))
    light = Spotlight((0.0, 1.2, 0.0), (0.0, 0.0, 0.0), 100.0, (3.0, 2.0, 1.0))
    scene = build(plane(), tilted, camera=Camera((0.0, 0.05, 0.0), (0.0, 2.0, 0.2), fov=80.0), spotlight=light)
    settings = {"shadow_maps.vpl_kernel": kernel, "shadow_maps.projection": projection, "vpl.fov": 140.0}
    value, lit = shown(renderer, scaled(scene, factor), "vpls", **settings)
    assert lit.mean() > 0.99
    assert value[lit].min() == 1.0


@pytest.mark.parametrize("projection", ["perspective", "paraboloid"])
def test_a_wide_filter_reads_no_tile_but_its_own(renderer, tmp_path, projection):
    """A free light amid lights of no power that something covers entirely, and alone."""
    cover = quad((-0.5, 1.9, 0.5), (0.5, 1.9, 0.5), (0.5, 1.9, -0.5))
    scene = build(plane(), cover, camera=Camera((0.3, 1.5, 2.5), (0.0, 0.0, 0.0)))
    free, covered = (0.0, 1.8, 0.0), (0.0, 1.95, 0.0)
    settings = {"shadow_maps.spot_size": 48, "shadow_maps.vpl_size": 16, "shadow_maps.projection": projection}
    settings |= {"shadow_maps.vpl_kernel": 12.0, "shadow_maps.vpl_taps": 32}
    images = []
    for places, powers in (([covered] * 4 + [free] + [covered] * 4, [0] * 4 + [1] + [0] * 4), ([free], [1])):
        lights = vpl_records(places, [(0, -1, 0)] * len(places), np.multiply.outer(powers, np.ones(3)))
        one = lit_by(renderer, tmp_path, lights, SIZE, "deferred", set=settings, dark=True)
        images.append(one.render(scene).radiance)
    assert images[0].max() > 0
    np.testing.assert_allclose(*images, rtol=1e-6)


@pytest.mark.parametrize("graph", GRAPHS)
@pytest.mark.parametrize("kernel", [5.0, 9.0, 17.0, 33.0])
def test_an_edge_is_as_wide_as_the_filter(renderer, graph, kernel):
    """A straight edge over a floor that faces the light: what a disc of comparisons of a texel's width makes of it."""
    half = quad((-2, 0.5, 2), (0.003, 0.5, 2), (0.003, 0.5, -2))
    light = Spotlight((0.0, 1.0, 0.0), (0.0, 0.0, 0.0), 60.0, (1.0, 1.0, 1.0))
    camera = Camera((0.0, 0.45, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, -1.0), 0.8)
    scene = build(plane(2.0), half, camera=camera, spotlight=light)
    settings = {"shadow_maps.spot_size": 256, "shadow_maps.spot_kernel": kernel, "shadow_maps.spot_taps": 64}
    with_edge, free = (
        renderer((512, 8), graph, set=settings).render(each, vpls=0).radiance[4, :, 0].astype(float)
        for each in (scene, replace(scene, geometry=build(plane(2.0)).geometry))
    )
    share = (with_edge / free)[40:-40]
    texel = 2 * np.tan(np.radians(30)) / 256
    pixel = 2 * 0.45 * np.tan(np.radians(0.4)) * 64 / 512
    width = ((share > 0.05) & (share < 0.95)).sum() * pixel / texel
    assert share.min() == 0.0
    assert share.max() == pytest.approx(1.0, abs=1e-5)
    rng = np.random.default_rng(0)
    disc = np.sqrt(rng.random(100_000)) * np.cos(2 * np.pi * rng.random(100_000))
    low, high = np.quantile(0.5 * (kernel - 1) * disc + rng.random(100_000), [0.05, 0.95])
    assert width == pytest.approx(high - low, rel=0.05)
