"""The graph `accurate`: the more VPLs are asked for, the more its samples do, and the less it errs."""

import numpy as np
import pytest
from distance import rel_mse, same_pixels
from small_scenes import crooked_room, room

from deferred_ir.base.errors import GraphError
from deferred_ir.truth.path_tracer import PathTracer


@pytest.fixture
def one(renderer):
    return renderer((64, 48), "accurate")


def test_the_more_vpls_the_less_it_errs(renderer, one):
    scene, size = crooked_room(), (64, 48)
    truth = renderer(size, "mapped", set={"interleave.n": 1, "shadow_rays.visibility": "rays"})
    truth = truth.render(scene, vpls=1024, seed=9, accumulate=4).radiance
    seen = np.ones(size[::-1], bool)
    errors = [
        np.mean(
            [rel_mse(one.render(scene, vpls=vpls, seed=seed).radiance, truth, seen, trim=0.01) for seed in range(3)]
        )
        for vpls in (64, 256, 1024)
    ]
    assert errors[1] < 0.7 * errors[0]
    assert errors[2] < 0.8 * errors[1]


def test_it_is_one_bounce_of_light(one):
    scene, size = room(), (64, 48)
    image = np.mean([one.render(scene, vpls=256, seed=seed).radiance for seed in range(4)], axis=0)
    truth = PathTracer(scene, one.tracer()).estimate(size, 256, seed=3)
    indirect = (image - truth.direct)[truth.hit].mean() / truth.indirect[truth.hit].mean()
    assert indirect == pytest.approx(1, abs=0.01)


@pytest.mark.parametrize(("vpls", "scale", "rays"), [(64, 2, 4), (128, 1, 8), (512, 1, 16)])
def test_the_effort_scales_samples_rays_and_lists(one, vpls, scale, rays):
    plan = one.plan(room(), vpls, ["radiance"])
    steps = {step.name: step for step in plan.steps}
    assert steps["sample_pixels"].outputs["blend"].defines["SCALE"] == scale
    assert steps["choose_vpls"].outputs["choices"].defines["RAYS"] == rays
    assert steps["choose_vpls"].outputs["choices"].description.layers == rays // 4
    assert steps["list_vpls"].outputs["numbers"].description.size[0] == 128 * rays


def test_with_few_vpls_it_is_resampled(renderer, one):
    scene, other = room(), renderer((64, 48), "resampled", set={"vpl.candidates": 16})
    assert same_pixels(one.render(scene, vpls=100), other.render(scene, vpls=100))


def test_more_rays_than_there_are_textures_for_are_refused(renderer):
    one = renderer((16, 12), "accurate", set={"choose_vpls.rays": 8})
    with pytest.raises(GraphError, match=r"choose_vpls: rays 8 times 4, .*: at most 16; use rays 4"):
        one.plan(room(), 1024)
