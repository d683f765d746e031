"""Images of many lights: how they add up; that order, seeds and units of length do what they should; none at all."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from distance import assert_same_but_for_edges
from fixed_lights import lit_by, vpl_records
from small_scenes import room, scaled

from deferred_ir.frame.vpl_buffer import VPL, VPLS_PER_BLOCK

SIZE = (96, 72)
GRAPHS = ("deferred", "forward")
DARK = (0.0, 0.0, 0.0)


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
        lit_by(renderer, tmp_path, records, SIZE, graph).render(scene).radiance
        for records in (lights, shuffled, retiled)
    ]
    if graph == "deferred":  # a light that keeps its tile keeps its map; forward has no tiles
        np.testing.assert_allclose(images[1], images[0], rtol=1e-5)
    assert_same_but_for_edges(images[2], images[0])


@pytest.mark.parametrize("graph", GRAPHS)
def test_more_lights_than_a_block_are_the_sum_of_their_parts(renderer, tmp_path, graph):
    scene, lights = room(), many(300)
    assert VPLS_PER_BLOCK < 300

    def image(records):
        records = records.copy()
        records["tile"] = np.arange(len(records))
        settings = {"shadow_maps.vpl_size": 64}
        return lit_by(renderer, tmp_path, records, SIZE, graph, set=settings, dark=True).render(scene).radiance

    parts = sum(image(lights[start : start + 100]).astype(float) for start in (0, 100, 200))
    assert_same_but_for_edges(image(lights), parts)


def test_lights_beyond_the_first_block_agree_with_forward(renderer, tmp_path):
    scene, records = room(), many(300)
    records["emission"][:VPLS_PER_BLOCK] = 0
    a, b = (lit_by(renderer, tmp_path, records, SIZE, graph, dark=True).render(scene).radiance for graph in GRAPHS)
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
    alone = lit_by(renderer, tmp_path, np.zeros(0, VPL), SIZE, graph).render(scene).radiance
    np.testing.assert_array_equal(renderer(SIZE, graph).render(scene, vpls=0).radiance, alone)


@pytest.mark.parametrize("graph", GRAPHS)
def test_a_dark_spotlight_gives_black_without_drawing_maps(renderer, graph):
    scene = replace(room(), lights=(replace(room().spotlight, emission=DARK),))
    one = renderer(SIZE, graph)
    image = one.render(scene, vpls=16)
    assert image.radiance.max() == 0
    assert image.display.max() == 0
    left_out = one.plan(scene, 16).left_out
    assert left_out.pop("cull_lights", "there are no VPLs").startswith("there are no VPLs")
    assert left_out["shadow_maps"] == "no light needs one: nothing shines"
    assert one.executor.counters["maps_drawn"] == 0
    assert one.render(room(), vpls=16).radiance.max() > 0  # and back
