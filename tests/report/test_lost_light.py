"""The estimate of what clamp and cone take, against cases with a known answer."""

import numpy as np
import pytest
from small_scenes import build, plane, room, sphere

from deferred_ir.rays.tracer import Tracer
from deferred_ir.report import lost_light
from deferred_ir.scene.camera import Camera
from deferred_ir.scene.lights.spotlight import Spotlight


def inside_a_sphere():
    mesh = sphere(subdivisions=5)
    light = Spotlight((0.0, 0.0, 0.0), (0.0, -1.0, 0.0), 179.0, (1.0, 1.0, 1.0))
    return build(mesh, camera=Camera((0.0, 0.0, 0.0), (0.0, 1.0, 0.0), (1.0, 0.0, 0.0), 90.0), spotlight=light)


def test_no_clamp_and_the_full_hemisphere_lose_nothing():
    scene = room()
    assert lost_light.estimate(scene, Tracer(scene), clamp=0, fov=180) == {"clamp": 0, "wide_light": 0}


def test_the_share_of_a_cone_is_that_of_the_spheres_chords():
    """Inside a sphere both ends of a chord make the same angle: beyond 75 degrees lie cos^2(75 deg) = 6.7 % of it.

    The camera looks up at a hemisphere lit from the whole lower one, so the share of what it sees is less; held against
    a straight integral over the lit hemisphere.
    """
    scene = inside_a_sphere()
    found = lost_light.estimate(scene, Tracer(scene), clamp=0, fov=150)
    rng = np.random.default_rng(0)
    directions = scene.camera.rays((64, 64)).reshape(-1, 3)
    seen = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    lit = rng.normal(size=(4096, 3))
    lit /= np.linalg.norm(lit, axis=1, keepdims=True)
    lit[:, 1] = -np.abs(lit[:, 1])
    power = scene.spotlight.cone(lit) * -lit[:, 1]  # irradiance of the unit sphere from its centre
    half_chord = np.linalg.norm(seen[:, None] - lit[None, :512], axis=2) / 2  # = cosine at both ends
    # The kernel cos cos / d^2 is 1/4 everywhere.
    share = (power[:512] * (half_chord < np.cos(np.radians(75)))).sum() / (power[:512] * np.ones_like(half_chord)).sum()
    assert found["wide_light"] == pytest.approx(-share, abs=0.004)


@pytest.mark.slow
def test_the_clamp_takes_more_the_larger_it_is():
    scene = room()
    losses = [lost_light.estimate(scene, Tracer(scene), clamp=c, fov=180)["clamp"] for c in (0.01, 0.05, 0.2, 5.0)]
    assert losses == sorted(losses, reverse=True)
    assert losses[0] < 0
    assert losses[-1] > -1


def test_what_short_rays_give_back_is_not_lost():
    scene = room()
    limits = {"clamp": 0.1, "fov": 120}
    plain, mended = (lost_light.estimate(scene, Tracer(scene), returned=back, **limits) for back in (False, True))
    assert mended["clamp"] == 0 > plain["clamp"]
    assert plain["wide_light"] < mended["wide_light"] < 0  # beyond the rays' reach the cone's loss stays
    assert lost_light.estimate(scene, Tracer(scene), returned=True, clamp=10, fov=120) == {
        "clamp": 0,
        "wide_light": 0,
    }


def test_without_indirect_light_there_is_nothing_to_lose():
    scene = build(plane())
    assert lost_light.estimate(scene, Tracer(scene), clamp=0.02, fov=150) is None
