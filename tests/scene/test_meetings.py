"""Rays meet lights where places drawn on them are, with the same radiance and density."""

from __future__ import annotations

import numpy as np
import pytest

from deferred_ir.profiling.light_scenes import SCENES, paint_sky
from deferred_ir.rays.tracer import Tracer
from deferred_ir.scene.environment_image import EnvironmentImage
from deferred_ir.scene.lights.base import Bounds
from deferred_ir.scene.lights.disc import Disc
from deferred_ir.scene.lights.environment import Environment
from deferred_ir.scene.lights.rect import Rect
from deferred_ir.scene.lights.sphere import Sphere

BOUNDS = Bounds((0.0, 0.0, 0.0), 5.0)
COUNT = 400
LIGHTS = {
    "rect": Rect((0.4, 2.7, 0.2), (0.2, 0.0, -0.3), (1.2, 0.7), (0.0, 0.0, -1.0), (7.0, 6.5, 6.0)),
    "disc": Disc((-0.5, 2.7, -0.2), (-0.3, 0.0, -0.5), 0.5, (7.0, 7.5, 8.0)),
    "sphere": Sphere((0.2, 3.0, 0.3), 0.35, (9.0, 8.0, 7.0)),
    "grey sky": Environment(radiance=(0.5, 0.6, 0.7)),
    "sky": Environment(image=EnvironmentImage(paint_sky(), "sky"), rotation=40.0, scale=2.0),
}


def draw(seed):
    rng = np.random.default_rng(seed)
    at = rng.uniform(-1, 1, (COUNT, 3))
    angle, radius = rng.uniform(0, 2 * np.pi, COUNT), np.sqrt(rng.uniform(0, 0.998, COUNT))
    return at, np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)


@pytest.mark.parametrize("name", LIGHTS)
def test_a_ray_towards_a_place_meets_it(name):
    light = LIGHTS[name]
    at, places = draw(1)
    found = light.sample(at, places, BOUNDS)
    lit = np.isfinite(found.density) & found.strength.reshape(COUNT, -1).any(axis=1)
    assert lit.mean() > 0.9
    met = light.meet(at, found.to)
    close = np.isclose(met.density, found.density, rtol=1e-6)
    assert close[lit].mean() > 0.98  # but where roundings choose the neighbouring cell of an image
    strength = found.strength if found.strength.ndim > 1 else found.strength[:, None]
    brought = strength * np.asarray(light.emission) * found.density[:, None]
    np.testing.assert_allclose(met.radiance[lit], brought[lit], rtol=1e-6)
    if not light.at_infinity:
        np.testing.assert_allclose(met.distance[lit], np.linalg.norm(found.ends - at, axis=1)[lit], rtol=1e-6)


@pytest.mark.parametrize("name", LIGHTS)
def test_densities_over_all_directions_add_up_to_one(name):
    rng = np.random.default_rng(2)
    ways = rng.normal(size=(200_000, 3))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    density = LIGHTS[name].meet(np.tile([0.1, 0.9, 0.2], (len(ways), 1)), ways).density
    assert density.mean() * 4 * np.pi == pytest.approx(1, abs=0.05)


@pytest.mark.parametrize("name", ["rect", "disc", "sphere"])
def test_rays_that_go_elsewhere_miss(name):
    light = LIGHTS[name]
    at, places = draw(3)
    away = -light.sample(at, places, BOUNDS).to
    met = light.meet(at, away)
    assert not np.isfinite(met.distance).any()
    assert not met.radiance.any()
    assert not met.density.any()


def test_emitting_surfaces_are_drawn_with_the_density_that_hits_have():
    scene = SCENES["panels"]()
    light, tracer = scene.surface_light, Tracer(scene)
    at, places = draw(4)
    at = at * [1.5, 0.8, 1.0] + [0.0, 1.2, 0.0]
    found = light.sample(at, places, scene.bounds)
    hits = tracer.closest(at, found.to)
    away = np.linalg.norm(hits.position - at, axis=1)
    seen = np.isclose(away, np.linalg.norm(found.ends - at, axis=1), rtol=1e-3) & np.isfinite(found.density)
    assert seen.mean() > 0.2
    density = light.find_density(hits.face, found.to, away)
    np.testing.assert_allclose(density[seen], found.density[seen], rtol=2e-3)
    radiance = tracer.find_emission(hits, found.to)
    brought = found.strength * np.where(np.isfinite(found.density), found.density, 0)[:, None]
    np.testing.assert_allclose(radiance[seen], brought[seen], rtol=0.02, atol=0.05)
