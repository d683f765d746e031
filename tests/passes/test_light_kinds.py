"""Each kind of light, and a mixture of all, in every graph: held against the baseline, against rays and each other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from deferred_ir.profiling.light_scenes import SCENES
from deferred_ir.rays.tracer import Tracer
from deferred_ir.truth.path_tracer import PathTracer

SIZE = (96, 64)
FEW = {"light_points.samples": 12, "shadow_maps.spot_size": 256, "shadow_maps.vpl_size": 64}
HARD = ["spotlight", "point", "spot", "directional"]


def rel_mse(image, truth):
    return float(((image - truth) ** 2 / (truth**2 + 0.01 * np.mean(truth) ** 2)).mean())


@pytest.mark.parametrize("name", SCENES)
def test_deferred_matches_the_baseline(renderer, name):
    scene = SCENES[name]()
    one, other = (renderer(SIZE, graph, set=FEW).render(scene, vpls=8).radiance for graph in ("forward", "deferred"))
    assert other.max() > 0
    # Culling finds edges of the cone by the same numbers, but a light that lies in a face may see another neighbour.
    assert rel_mse(other, one) < 1e-5


@pytest.mark.parametrize("graph", ["deferred", "interleaved", "mapped", "resampled", "incremental"])
def test_leaving_out_changes_no_bit(renderer, graph):
    scene = SCENES["mixture"]()
    few = {key: value for key, value in FEW.items() if not (graph == "resampled" and key.startswith("shadow"))}
    images = [
        renderer(SIZE, graph, set=few, keep_all=keep_all).render(scene, vpls=8).radiance for keep_all in (False, True)
    ]
    np.testing.assert_array_equal(*images)


@pytest.mark.parametrize("name", SCENES)
def test_direct_light_by_maps_is_that_of_rays(renderer, name):
    """Of the same points of lights: maps and rays differ along the borders of shadows only."""
    scene, settings = SCENES[name](), {**FEW, "shadow_maps.spot_size": 1024, "shadow_maps.vpl_size": 512}
    maps = renderer(SIZE, "hemisphere", set=settings).render(scene, vpls=0).radiance
    rays = renderer(SIZE, "mapped", set={**settings, "shadow_rays.visibility": "rays", "interleave.n": 1})
    traced = rays.render(scene, vpls=0).radiance
    off = np.abs(maps - traced) > 0.05 * traced.mean()
    assert off.any(axis=-1).mean() < (0.1 if "soft" in name or name == "mixture" else 0.05)
    assert maps.mean() == pytest.approx(traced.mean(), rel=0.01)


@pytest.mark.parametrize("name", HARD)
def test_hard_lights_match_the_path_tracer(renderer, name):
    scene = SCENES[name]()
    truth = PathTracer(scene, Tracer(scene)).estimate_direct(SIZE, 1)
    found = renderer(SIZE, "deferred").render(scene, vpls=0).radiance
    off = (np.abs(found - truth) > 0.02 * truth.mean() + 0.02 * truth).any(axis=-1)
    assert off.mean() < 0.03  # pixels on the borders of shadows
    assert found[~off].mean() == pytest.approx(truth[~off].mean(), rel=1e-3)
    traced = renderer(SIZE, "resampled").render(scene, vpls=0).radiance
    off = (np.abs(traced - truth) > 2e-3 * truth.mean() + 2e-3 * truth).any(axis=-1)
    assert off.mean() < 1e-3  # pixels on the edge of a face, whose neighbour one of the two sees


@pytest.mark.parametrize("name", ["rect", "disc", "sphere", "grey sky", "open sky", "panels"])
def test_points_bring_the_light_that_they_stand_for(renderer, name):
    scene = SCENES[name]()
    tracer = Tracer(scene)
    truth = PathTracer(scene, tracer, bounces=0).estimate(SIZE, 64)
    one = renderer(SIZE, "deferred", set={"light_points.samples": 256})
    found = np.mean([one.render(scene, vpls=0, seed=seed).radiance for seed in range(2)], axis=0)
    hit = truth.hit
    expected = truth.direct + truth.emission
    # Parallel maps cover the whole scene: within a texel of the walls they let in light from outside.
    assert found[hit].mean() == pytest.approx(expected[hit].mean(), rel=0.03 if "sky" in name else 0.02)
    assert rel_mse(found[hit], expected[hit]) < (0.06 if "sky" in name else 0.01)
    np.testing.assert_allclose(found[~hit], expected[~hit], rtol=1e-3, atol=1e-6)


def test_an_environment_turns_about_the_vertical(renderer):
    scene = SCENES["open sky"]()
    sky = scene.lights[0]
    one = renderer(SIZE, "deferred", set=FEW)
    images = [
        one.render(replace(scene, lights=(replace(sky, rotation=turn),)), vpls=0).radiance
        for turn in (25.0, 385.0, 90.0)
    ]
    np.testing.assert_allclose(images[0], images[1], rtol=1e-3, atol=1e-3)
    assert rel_mse(images[2], images[0]) > 0.01


@pytest.mark.parametrize("graph", ["forward", "deferred", "resampled"])
def test_more_lights_than_a_block_holds(renderer, graph):
    """Forty spotlights of a fortieth each are as one."""
    scene = SCENES["spotlight"]()
    light = scene.spotlight
    weak = replace(light, emission=tuple(value / 40 for value in light.emission))
    dark = replace(light, emission=(0.0, 0.0, 0.0))
    one = renderer(SIZE, graph, set={} if graph == "resampled" else {"shadow_maps.spot_size": 128})
    expected = one.render(scene, vpls=0).radiance
    for lights in ((weak,) * 40, (dark,) * 70 + (light,) + (dark,) * 30):
        found = one.render(replace(scene, lights=lights), vpls=0).radiance
        np.testing.assert_allclose(found, expected, rtol=1e-3, atol=1e-5 * expected.mean())


def test_maps_of_many_lights_stay_within_the_budget(renderer):
    scene = SCENES["point"]()
    light = scene.lights[0]
    rng = np.random.default_rng(0)
    lights = tuple(replace(light, position=tuple(rng.uniform((-1, 1, -1), (1, 2, 1)).tolist())) for _ in range(20))
    one = renderer(SIZE, "deferred", set={"shadow_maps.budget": 64})
    one.render(replace(scene, lights=lights), vpls=0)
    atlas = one.executor.resource(("shadow_maps", "atlas"))
    assert atlas.nbytes <= 64 * 2**20
    assert one.executor.counters["maps_drawn"] > 20
