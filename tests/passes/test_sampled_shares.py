"""Shares of VPLs at samples (graph `incremental`): what all pixels would get, and only on the samples' own surfaces."""

from dataclasses import replace

import numpy as np
import pytest
from distance import assert_same_but_for_edges, rel_mse
from small_scenes import build, crooked_room, plane, quad, room, smooth_scene

from deferred_ir.base.errors import GraphError
from deferred_ir.scene.camera import Camera
from deferred_ir.scene.lights.spotlight import Spotlight

COUNT = 32
WHOLE = {"vpl.count": COUNT, "vpl.most": COUNT, "shadow_maps.vpl_size": 64, "direct_rays.visibility": "maps"}
ALL_PIXELS = {"sample_pixels.scale": 1, "interleave.n": 4, "neighbours.fewest": 0.5}
EVERYWHERE = {"interleave.n": 1}
ALONE = {"neighbours.angle": 0.0}
"""No pixel has a neighbour, so each asks what it lacks itself."""


@pytest.fixture
def interleaved(tmp_path):
    """A graph that has the same VPLs and shades all pixels by shares."""
    graph = tmp_path / "all_pixels.toml"
    graph.write_text('extends = "interleaved"\n[passes.vpl]\ntype = "incremental_vpl"\n')
    return graph


def rendered(make, scene, graph="incremental", size=(64, 48), seed=0, **settings):
    given = {key: value for key, value in WHOLE.items() if graph == "incremental" or "direct" not in key}
    return make(size, graph, set=given | settings).render(scene, seed=seed).radiance


@pytest.mark.parametrize("scene", [crooked_room(), smooth_scene()], ids=["flat", "smooth"])
@pytest.mark.parametrize("seed", [0, 3])
def test_at_every_pixel_shares_are_those_of_interleaved(renderer, interleaved, scene, seed):
    images = rendered(renderer, scene, seed=seed, **ALL_PIXELS), rendered(renderer, scene, interleaved, seed=seed)
    assert_same_but_for_edges(*images)


@pytest.mark.parametrize(("scale", "most"), [(2, 0.02), (3, 0.04), (4, 0.06)])
@pytest.mark.parametrize("size", [(96, 72), (97, 71)])
def test_few_samples_show_what_all_pixels_would(renderer, scale, most, size):
    settings = {"sample_pixels.scale": scale}
    few, every = (
        [rendered(renderer, room(), size=size, seed=seed, **given) for seed in range(4)]
        for given in (settings, EVERYWHERE)
    )
    everywhere = np.ones(every[0].shape[:2], bool)
    assert np.mean([rel_mse(*images, everywhere, trim=1e-2) for images in zip(few, every, strict=True)]) < most
    assert np.mean(few) == pytest.approx(np.mean(every), rel=0.01)


def test_without_shares_all_pixels_ask_all_vpls(renderer, interleaved):
    one = renderer((32, 24), "incremental", set=WHOLE | EVERYWHERE)
    assert not {"light_shares", "neighbours", "gather"} & {step.name for step in one.plan(room()).steps}
    np.testing.assert_array_equal(
        one.render(room()).radiance, rendered(renderer, room(), interleaved, size=(32, 24), **EVERYWHERE)
    )


@pytest.mark.parametrize("scale", [2, 4])
@pytest.mark.parametrize("n", [2, 4])
def test_no_light_crosses_an_edge(renderer, scale, n):
    """The light falls upon the floor behind a fence, whose front it does not reach."""
    fence = [quad((x, -1, 1.5), (x + 0.08, -1, 1.5), (x + 0.08, -0.2, 1.5)) for x in np.arange(-2, 2, 0.2)]
    scene = build(
        plane(2.0, -1.0),
        *fence,
        camera=Camera((0.0, 0.8, 4.0), (0.0, -0.5, 0.0), fov=50.0),
        spotlight=Spotlight((0.0, 1.5, 0.0), (0.0, -1.0, 0.0), 60.0, (3.0, 2.5, 2.0)),
    )
    size, settings = (96, 80), {"sample_pixels.scale": scale, "interleave.n": n}
    dark = rendered(renderer, scene, size=size, **EVERYWHERE).max(axis=-1) == 0
    assert 0.5 < dark.mean() < 0.98
    assert rendered(renderer, scene, size=size, **settings)[dark].max() == 0


@pytest.mark.parametrize("size", [(32, 24), (33, 21), (21, 1), (1, 21)])
@pytest.mark.parametrize("graph", ["incremental", "interleaved"])
def test_pixels_without_neighbours_ask_all_vpls(renderer, interleaved, graph, size):
    """The list of lonely pixels then holds all of them, in frames of odd sizes, too."""
    which, settings = (interleaved, {}) if graph == "interleaved" else (graph, ALL_PIXELS)
    alone = rendered(renderer, room(), which, size=size, **settings, **ALONE)
    np.testing.assert_allclose(alone, rendered(renderer, room(), which, size=size, **EVERYWHERE), rtol=1e-4, atol=1e-7)


def test_a_standing_camera_chooses_no_samples_anew(renderer):
    one = renderer((48, 32), "incremental", set=WHOLE, reuse=True)
    plan, scene = one.plan(room()), room()
    for step in range(3):
        x, y, z = scene.spotlight.position
        scene = replace(scene, lights=(replace(scene.spotlight, position=(x + 0.05, y, z)),))
        one.draw(scene, plan)
        assert one.executor.counters["samples"] >= 24 * 16
        assert ({"gbuffer", "sample_pixels", "neighbours"} <= set(one.executor.skipped)) == (step > 0)
        assert not {"light_shares", "gather", "lighting"} & set(one.executor.skipped)


def test_only_one_who_asks_is_connected(renderer, tmp_path):
    graph = tmp_path / "both.toml"
    graph.write_text('extends = "incremental"\n[passes.gather]\ninputs = { depth = "gbuffer.depth" }\n')
    with pytest.raises(GraphError, match="gather: connect either depth, for all pixels, or layout and positions, for"):
        renderer((32, 24), graph).plan(room())
