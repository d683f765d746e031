"""What lights do to a plane, pixel by pixel against closed forms, and how images of many lights hang together."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from distance import assert_same_but_for_edges
from fixed_lights import lit_by, spot_record, vpl_records
from small_scenes import build, plane, quad, room, scaled

from deferred_ir.camera import Camera
from deferred_ir.lights import LIGHTS_PER_BLOCK, Spotlight
from deferred_ir.tracing import Tracer

SIZE = (96, 72)
GRAPHS = ("deferred", "forward")
ALBEDO = (0.5, 0.25, 0.125)  # exact in half floats
DARK = (0.0, 0.0, 0.0)


def floor(fov: float = 80.0, height: float = 1.5) -> object:
    """A plane at y = 0 seen at a slant, with background around it, lit from `height`."""
    return build(
        plane(2.0, albedo=ALBEDO),
        camera=Camera((0.3, 2.5, 3.5), (0.0, 0.0, 0.0), fov=60.0),
        spotlight=Spotlight((0.2, height, -0.3), (-0.1, 0.0, 0.2), fov, (3.0, 2.0, 1.0)),
    )


def seen(scene):
    """Positions (H, W, 3) under the pixels, and which pixels show something."""
    rays = scene.camera.rays(SIZE).reshape(-1, 3)
    hits = Tracer(scene).closest(np.broadcast_to(scene.camera.position, rays.shape), rays)
    return hits.position.reshape(SIZE[1], SIZE[0], 3), hits.hit.reshape(SIZE[1], SIZE[0])


def eroded(mask):
    """Pixels whose four neighbours belong to `mask`, too: a centre may lie exactly on a silhouette."""
    inner = mask.copy()
    for axis in (0, 1):
        for step in (-1, 1):
            inner &= np.roll(mask, step, axis)
    return inner


def spot_radiance(scene, positions):
    """rho/pi E cos(theta) cone(theta) cos_x / d^2 on a floor."""
    light = scene.spotlight
    way = positions - light.position
    distance = np.linalg.norm(way, axis=-1)
    towards = way / distance[..., None]
    intensity = np.maximum(towards @ light.axis, 0) * light.cone(towards)
    return (
        (intensity * np.maximum(-towards[..., 1], 0) / distance**2)[..., None]
        * np.array(ALBEDO)
        * light.emission
        / np.pi
    )


@pytest.mark.parametrize("graph", GRAPHS)
@pytest.mark.parametrize("fov", [10.0, 80.0, 170.0])
def test_the_spotlight_on_a_floor(renderer, graph, fov):
    scene = floor(fov)
    radiance = renderer(SIZE, graph).render(scene, vpls=0).radiance
    positions, shown = seen(scene)
    expected = spot_radiance(scene, positions)
    assert expected[shown].max() > 0.1
    inside, background = eroded(shown), eroded(~shown)
    np.testing.assert_allclose(radiance[inside], expected[inside], rtol=1e-4, atol=1e-5 * expected[shown].max())
    assert background.sum() > 100
    assert (radiance[background] == 0).all()


def test_a_very_narrow_spotlight_keeps_its_soft_edge(renderer):
    """Half a degree, from far above: cosines in single precision would show steps."""
    scene = floor(0.5, height=150.0)
    light = replace(scene.spotlight, position=(0.1, 150.0, 0.2), look_at=(0.0, 0.0, 0.0), emission=(3e4, 3e4, 3e4))
    scene = replace(scene, spotlight=light, camera=Camera((0.0, 1.5, 0.4), (0.0, 0.0, 0.0), fov=60.0))
    radiance = renderer(SIZE, "deferred").render(scene, vpls=0).radiance
    positions, shown = seen(scene)
    expected = spot_radiance(scene, positions)
    edge = shown & (expected[..., 0] < 0.99 * expected[..., 0].max()) & (expected[..., 0] > 0)
    assert edge.sum() > 300
    np.testing.assert_allclose(radiance[shown], expected[shown], atol=1e-3 * expected.max())


@pytest.mark.parametrize("graph", GRAPHS)
@pytest.mark.parametrize(("fov", "clamp"), [(150.0, 0.0), (60.0, 0.0), (179.0, 0.0), (150.0, 1.2)])
def test_a_vpl_on_a_floor(renderer, tmp_path, graph, fov, clamp):
    scene = floor()
    position, normal, emission = np.array([0.2, 0.7, 0.1]), np.array([0.1, -1.0, 0.3]), np.array([0.5, 1.0, 2.0])
    records = np.concatenate(
        [spot_record(scene, DARK), vpl_records([position], [normal], [emission], fov=fov, clamp=clamp)]
    )
    radiance = lit_by(renderer, tmp_path, records, SIZE, graph).render(scene).radiance
    positions, shown = seen(scene)
    way = positions - position
    square = (way**2).sum(axis=-1)
    cos_y = way @ (normal / np.linalg.norm(normal)) / np.sqrt(square)
    cos_x = position[1] / np.sqrt(square)
    lit = cos_y > np.cos(np.radians(fov / 2))
    form = np.where(lit, cos_y * cos_x / np.maximum(square, clamp**2), 0)
    expected = form[..., None] * np.array(ALBEDO) * emission / np.pi
    sure = eroded(shown) & (np.abs(cos_y - np.cos(np.radians(fov / 2))) > 1e-4)
    assert sure.sum() > 0.9 * shown.sum()
    assert (expected[sure] > 0).any()
    if fov < 100:
        assert (expected[sure] == 0).any()
    np.testing.assert_allclose(radiance[sure], expected[sure], rtol=1e-4, atol=1e-6 * expected.max())


@pytest.mark.parametrize("graph", GRAPHS)
def test_the_clamp_spares_the_spotlight(renderer, tmp_path, graph):
    scene = floor()
    record = spot_record(scene)
    record["clamp_squared"] = 100.0
    clamped = lit_by(renderer, tmp_path, record, SIZE, graph).render(scene).radiance
    np.testing.assert_array_equal(clamped, renderer(SIZE, graph).render(scene, vpls=0).radiance)


@pytest.mark.parametrize("graph", GRAPHS)
def test_light_from_behind_a_face_does_not_shine_through(renderer, tmp_path, graph):
    scene = floor()
    records = np.concatenate([spot_record(scene, DARK), vpl_records([(0, -0.5, 0)], [(0, 1, 0)], [(1, 1, 1)])])
    assert lit_by(renderer, tmp_path, records, SIZE, graph).render(scene).radiance.max() == 0


# Shadows

OCCLUDER = quad((-0.25, 0.75, 0.25), (0.25, 0.75, 0.25), (0.25, 0.75, -0.25), (0.3, 0.3, 0.3))
"""A square half-way between the floor and a light at (0, 1.5, 0): its shadow is the square twice as large."""


def shadow_scene():
    return build(
        plane(2.0, albedo=ALBEDO),
        OCCLUDER,
        camera=Camera((0.4, 1.4, 3.0), (0.0, 0.0, 0.0), fov=60.0),
        spotlight=Spotlight((0.0, 1.5, 0.0), (0.0, 0.0, 0.0), 80.0, (3.0, 2.0, 1.0)),
    )


def check_shadow(scene, radiance, unshadowed, texel):
    """Dark inside the square of 1 x 1, as without occluder outside, two texels of the map from its edge left out."""
    positions, shown = seen(scene)
    on_floor = shown & (np.abs(positions[..., 1]) < 1e-3)
    edge_distance = np.abs(positions[..., [0, 2]]).max(axis=-1) - 0.5
    inside, outside = on_floor & (edge_distance < -2 * texel), on_floor & (edge_distance > 2 * texel)
    assert inside.sum() > 100
    assert outside.sum() > 500
    assert (radiance[inside] == 0).all()
    np.testing.assert_allclose(radiance[outside], unshadowed[outside], rtol=1e-5, atol=1e-5 * unshadowed.max())
    assert (unshadowed[inside] > 0).all()


@pytest.mark.parametrize("graph", GRAPHS)
def test_an_occluder_shades_the_spotlight_where_it_should(renderer, graph):
    scene = shadow_scene()
    bare = build(plane(2.0, albedo=ALBEDO), camera=scene.camera, spotlight=scene.spotlight)
    one = renderer(SIZE, graph)
    texel = 2 * 1.5 * np.tan(np.radians(40)) / 2048
    check_shadow(scene, one.render(scene, vpls=0).radiance, one.render(bare, vpls=0).radiance, texel)


@pytest.mark.parametrize("graph", GRAPHS)
@pytest.mark.parametrize("tile", [0, 5, 17])
def test_an_occluder_shades_a_vpl_where_it_should_in_any_tile(renderer, tmp_path, graph, tile):
    """The light that counts stands among dark ones, which own the other tiles."""
    scene = shadow_scene()
    bare = build(plane(2.0, albedo=ALBEDO), camera=scene.camera, spotlight=scene.spotlight)
    emission = np.zeros((20, 3))
    emission[tile] = 1.0
    lights = vpl_records(np.tile((0.0, 1.5, 0.0), (20, 1)), np.tile((0.0, -1, 0), (20, 1)), emission, fov=120.0)
    lights["position"][np.arange(20) != tile] += (0.3, 0.2, -0.1)
    records = np.concatenate([spot_record(scene, DARK), lights])
    one = lit_by(renderer, tmp_path, records, SIZE, graph)
    texel = 2 * 1.5 * np.tan(np.radians(60)) / 256
    check_shadow(scene, one.render(scene).radiance, one.render(bare).radiance, texel)


# Many lights


def many(count: int, seed: int = 0):
    """VPLs on the walls of `room`, looking inwards."""
    rng = np.random.default_rng(seed)
    position = rng.uniform(-0.9, 0.9, (count, 3))
    side, axis = rng.integers(0, 2, count) * 2 - 1, rng.integers(0, 3, count)
    position[np.arange(count), axis] = side
    normal = np.zeros((count, 3))
    normal[np.arange(count), axis] = -side
    return vpl_records(position, normal, rng.uniform(0, 2 / count, (count, 3)), clamp=0.05)


@pytest.mark.parametrize("graph", GRAPHS)
def test_the_order_of_lights_does_not_matter(renderer, tmp_path, graph):
    scene, lights = room(), many(70)
    shuffled = np.random.default_rng(1).permutation(lights)
    retiled = shuffled.copy()
    retiled["tile"] = np.arange(70)
    images = [
        lit_by(renderer, tmp_path, np.concatenate([spot_record(scene), records]), SIZE, graph).render(scene).radiance
        for records in (lights, shuffled, retiled)
    ]
    if graph == "deferred":  # a light that keeps its tile keeps its map; forward has no tiles
        np.testing.assert_allclose(images[1], images[0], rtol=1e-5)
    assert_same_but_for_edges(images[2], images[0])


@pytest.mark.parametrize("graph", GRAPHS)
def test_more_lights_than_a_block_are_the_sum_of_their_parts(renderer, tmp_path, graph):
    scene, lights = room(), many(300)
    assert LIGHTS_PER_BLOCK < 300

    def image(records):
        records = records.copy()
        records["tile"] = np.arange(len(records))
        whole = np.concatenate([spot_record(scene, DARK), records])
        return lit_by(renderer, tmp_path, whole, SIZE, graph, set={"shadow_maps.vpl_size": 64}).render(scene).radiance

    parts = sum(image(lights[start : start + 100]).astype(float) for start in (0, 100, 200))
    assert_same_but_for_edges(image(lights), parts)


def test_lights_beyond_the_first_block_agree_with_forward(renderer, tmp_path):
    scene, lights = room(), many(300)
    records = np.concatenate([spot_record(scene, DARK), lights])
    records["emission"][: LIGHTS_PER_BLOCK + 1] = 0
    a, b = (lit_by(renderer, tmp_path, records, SIZE, graph).render(scene).radiance for graph in GRAPHS)
    assert_same_but_for_edges(a, b)


@pytest.mark.parametrize("graph", GRAPHS)
def test_the_same_seed_is_the_same_image_bit_for_bit(renderer, graph):
    scene = room()
    one, other = renderer(SIZE, graph), renderer(SIZE, graph)
    first = one.render(scene, vpls=32, seed=5)
    np.testing.assert_array_equal(one.render(scene, vpls=32, seed=5).radiance, first.radiance)
    np.testing.assert_array_equal(other.render(scene, vpls=32, seed=5).radiance, first.radiance)
    np.testing.assert_array_equal(other.render(scene, vpls=32, seed=5).display, first.display)
    assert np.abs(one.render(scene, vpls=32, seed=6).radiance - first.radiance).max() > 1e-3


@pytest.mark.parametrize("graph", GRAPHS)
@pytest.mark.parametrize("factor", [2.0**-10, 2.0**10])
def test_units_of_length_that_are_powers_of_two_change_nothing(renderer, graph, factor):
    one, scene = renderer(SIZE, graph), room()
    here, there = (one.render(s, vpls=24, seed=1).radiance for s in (scene, scaled(scene, factor)))
    np.testing.assert_allclose(there, here, rtol=1e-5, atol=1e-7)


@pytest.mark.parametrize("factor", [0.001, 1000.0])
def test_units_of_length_do_not_matter(renderer, factor):
    """Other factors round differently, which moves the edge of a hard shadow in a few pixels."""
    one, scene = renderer(SIZE, "deferred"), room()
    here, there = (one.render(s, vpls=24, seed=1).radiance for s in (scene, scaled(scene, factor)))
    assert_same_but_for_edges(there, here)


@pytest.mark.parametrize("graph", GRAPHS)
def test_no_vpls_is_the_spotlight_alone(renderer, tmp_path, graph):
    scene = room()
    alone = lit_by(renderer, tmp_path, spot_record(scene), SIZE, graph).render(scene).radiance
    np.testing.assert_array_equal(renderer(SIZE, graph).render(scene, vpls=0).radiance, alone)


@pytest.mark.parametrize("graph", GRAPHS)
def test_a_dark_spotlight_gives_black_without_drawing_maps(renderer, graph):
    scene = replace(room(), spotlight=replace(room().spotlight, emission=DARK))
    one = renderer(SIZE, graph)
    image = one.render(scene, vpls=16)
    assert image.radiance.max() == 0
    assert image.display.max() == 0
    assert one.plan(scene, 16).left_out == {"shadow_maps": "no light needs one: the spotlight emits nothing"}
    assert one.executor.counters["maps_drawn"] == 0
    assert one.render(room(), vpls=16).radiance.max() > 0  # and back


@pytest.mark.parametrize("graph", GRAPHS)
def test_a_light_that_hits_nothing_leaves_the_direct_light(renderer, graph):
    scene = floor()
    up = replace(scene, spotlight=replace(scene.spotlight, look_at=(0.2, 9.0, -0.3)))
    one = renderer(SIZE, graph)
    assert one.render(up, vpls=16).radiance.max() == 0
    assert one.executor.counters["vpls_alive"] == 0
    assert one.executor.counters["maps_drawn"] == 1


@pytest.mark.parametrize("graph", GRAPHS)
def test_a_light_on_a_surface_and_a_camera_on_the_light_give_finite_numbers(renderer, tmp_path, graph):
    scene = floor()
    spot = Spotlight((0.3, 0.0, 0.0), (0.3, -1.0, 0.0), 120.0, (1.0, 1.0, 1.0))
    lights = vpl_records([(0.0, 0.0, 0.0), scene.camera.position], [(0, 1, 0), (0, -1, 0)], [(1, 1, 1)] * 2)
    there = replace(scene, spotlight=spot)
    image = lit_by(renderer, tmp_path, np.concatenate([spot_record(there), lights]), SIZE, graph).render(there)
    assert np.isfinite(image.radiance).all()
