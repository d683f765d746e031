"""Every kind of light on its own: its rays, its samples and its points carry the same light, and move as one."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from small_scenes import room

from deferred_ir.base.colour import LUMINANCE
from deferred_ir.rays.tracer import Tracer
from deferred_ir.sampling.patterns import sample_unit_square
from deferred_ir.sampling.warps import disc_to_square, square_to_disc
from deferred_ir.scene.environment_image import EnvironmentImage
from deferred_ir.scene.lights.base import Bounds, is_direct, is_sampled
from deferred_ir.scene.lights.directional import Directional
from deferred_ir.scene.lights.disc import Disc
from deferred_ir.scene.lights.environment import Environment
from deferred_ir.scene.lights.kinds import find_kinds
from deferred_ir.scene.lights.point import Point
from deferred_ir.scene.lights.rect import Rect
from deferred_ir.scene.lights.sphere import Sphere
from deferred_ir.scene.lights.spot import Spot
from deferred_ir.scene.lights.spotlight import Spotlight
from deferred_ir.vpls.cast import deal_rays
from deferred_ir.vpls.kept_lights import KeptVpls

BOUNDS = Bounds((0.2, 0.1, -0.3), 3.0)
COUNT = 1 << 16
HALF = 0.8
"""Half the edge of the square at y = 0 about the origin that lights shine at."""
COLOUR = (3.0, 2.0, 1.0)
AT, AIM = (0.3, 1.7, -0.2), (0.0, 0.0, 0.1)


def paint(height: int = 16, width: int = 32) -> np.ndarray:
    """Random radiance, some of it bright."""
    return np.random.default_rng(4).gamma(0.5, 1.0, (height, width, 3)).astype(np.float32)


LIGHTS: dict[str, Any] = {
    "spotlight": Spotlight(AT, AIM, 70.0, COLOUR),
    "spotlight of a disc": Spotlight(AT, AIM, 70.0, COLOUR, 0.2),
    "point": Point(AT, COLOUR),
    "point of a ball": Point(AT, COLOUR, 0.2),
    "spot": Spot(AT, AIM, 70.0, 30.0, COLOUR),
    "spot with a hard edge": Spot(AT, AIM, 60.0, 60.0, COLOUR),
    "directional": Directional(AT, AIM, COLOUR),
    "directional of a disc": Directional(AT, AIM, COLOUR, 10.0),
    "rect": Rect(AT, AIM, (0.6, 0.4), (0.0, 0.2, 1.0), COLOUR),
    "disc": Disc(AT, AIM, 0.3, COLOUR),
    "sphere": Sphere(AT, 0.3, COLOUR),
    "environment": Environment(radiance=COLOUR),
    "environment of an image": Environment(image=paint(), rotation=40.0, scale=1.5),
}
MOVED = (1.0, -2.0, 0.5)
every = pytest.mark.parametrize("light", LIGHTS.values(), ids=LIGHTS.keys())


def spread_evenly(seed: int, count: int = COUNT) -> tuple[np.ndarray, np.ndarray]:
    """Points of the unit disc, twice, which have nothing to do with each other."""
    first, other = (sample_unit_square("sobol", count, seed + i) for i in (0, 17))
    return square_to_disc(first), square_to_disc(np.random.default_rng(seed).permutation(other))


def emit(light: Any, seed: int = 1) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    points, places = spread_evenly(seed)
    return light.emit(points, places if light.has_area else None, BOUNDS)


def sample(light: Any, at: np.ndarray, seed: int = 3) -> Any:
    _, places = spread_evenly(seed, len(at))
    return light.sample(at, places if light.has_area else None, BOUNDS)


def test_each_kind_is_tested() -> None:
    assert {light.kind for light in LIGHTS.values()} == set(find_kinds())
    assert all(is_direct(light) != is_sampled(light) for light in LIGHTS.values())


@every
def test_rays_carry_the_whole_flux(light: Any) -> None:
    """The table that an image's flux and directions go by knows bilinear means, rays the values themselves."""
    origins, directions, carried = emit(light)
    assert origins.shape == directions.shape == carried.shape == (COUNT, 3)
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1, atol=1e-9)
    assert (carried >= 0).all()
    assert (carried @ LUMINANCE).sum() == pytest.approx(light.measure_flux(BOUNDS), rel=5e-3)


@every
def test_flux_is_in_proportion_to_emission(light: Any) -> None:
    keys = {field.name for field in fields(light)}
    name = next(key for key in ("scale", "emission", "intensity", "irradiance", "radiance") if key in keys)
    brighter = replace(light, **{name: np.multiply(getattr(light, name), 3).tolist()})
    assert brighter.measure_flux(BOUNDS) == pytest.approx(3 * light.measure_flux(BOUNDS))
    np.testing.assert_allclose(brighter.emission, np.multiply(light.emission, 3))


def measure_by_rays(light: Any) -> np.ndarray:
    """Flux over pi that comes down to the square, (3,)."""
    return np.mean([_measure_by_rays(*emit(light, seed)) for seed in range(16)], axis=0)


def _measure_by_rays(origins: np.ndarray, directions: np.ndarray, carried: np.ndarray) -> np.ndarray:
    down = directions[:, 1] < 0
    reach = -origins[down, 1] / directions[down, 1]
    landing = origins[down] + reach[:, None] * directions[down]
    inside = (reach > 0) & (np.abs(landing[:, [0, 2]]) < HALF).all(axis=1)
    return carried[down][inside].sum(axis=0)


def make_square() -> np.ndarray:
    square = (sample_unit_square("sobol", COUNT, 9) * 2 - 1) * HALF
    return np.stack([square[:, 0], np.zeros(COUNT), square[:, 1]], axis=1)


@every
def test_rays_and_samples_bring_the_same_light_to_a_plane(light: Any) -> None:
    found = sample(light, make_square())
    np.testing.assert_allclose(np.linalg.norm(found.to, axis=1), 1, atol=1e-9)
    strength = np.asarray(found.strength).reshape(COUNT, -1)
    irradiance = strength * np.maximum(found.to[:, 1:2], 0) * light.emission
    flux = irradiance.mean(axis=0) * (2 * HALF) ** 2 / np.pi
    np.testing.assert_allclose(measure_by_rays(light), flux, rtol=0.02)


@pytest.mark.parametrize("name", [name for name, light in LIGHTS.items() if is_sampled(light)])
def test_points_bring_the_light_of_samples(name: str) -> None:
    light = LIGHTS[name]
    at = np.array([0.1, 0.0, 0.3])
    points = light.spread(sample_unit_square("sobol", COUNT, 5), BOUNDS)
    np.testing.assert_allclose(np.linalg.norm(points.normal, axis=1), 1, atol=1e-9)
    way = at - points.position
    square = (way**2).sum(axis=1)
    to, weight = -way / np.sqrt(square)[:, None], np.maximum((points.normal * way).sum(axis=1), 0) / square**1.5
    if light.at_infinity:
        to, weight = -points.normal, np.ones(COUNT)
    irradiance = (points.emission * (weight * np.maximum(to[:, 1], 0))[:, None]).sum(axis=0)
    found = sample(light, np.tile(at, (COUNT, 1)))
    strength = np.asarray(found.strength).reshape(COUNT, -1)
    wanted = (strength * np.maximum(found.to[:, 1:2], 0) * light.emission).mean(axis=0)
    np.testing.assert_allclose(irradiance, wanted, rtol=0.01)


@every
def test_shadow_rays_end_on_the_light_or_outside_the_scene(light: Any) -> None:
    at = make_square()[:512]
    found = sample(light, at)
    away = np.linalg.norm(found.ends - at, axis=1)
    np.testing.assert_allclose(at + away[:, None] * found.to, found.ends, atol=1e-9)
    if hasattr(light, "position") and light.kind != "directional":
        size = getattr(light, "radius", 0.0) or np.linalg.norm(getattr(light, "size", 0.0)) / 2
        assert (np.linalg.norm(found.ends - light.position, axis=1) <= size + 1e-9).all()
    else:
        assert (np.linalg.norm(found.ends - BOUNDS.centre, axis=1) > BOUNDS.radius).all()


@every
def test_moved_lights_shine_as_before_from_elsewhere(light: Any) -> None:
    moved = light.translate(MOVED)
    assert moved.motion is None
    assert moved.at(3.0) == moved
    assert light.at(3.0) == light
    there = Bounds(tuple(np.add(BOUNDS.centre, MOVED).tolist()), BOUNDS.radius)
    assert moved.measure_flux(there) == pytest.approx(light.measure_flux(BOUNDS))
    points, places = spread_evenly(2, 64)
    given_places = places if light.has_area else None
    before, after = light.emit(points, given_places, BOUNDS), moved.emit(points, given_places, there)
    np.testing.assert_allclose(before[0] + MOVED, after[0], atol=1e-9)
    np.testing.assert_allclose(before[1], after[1], atol=1e-9)
    np.testing.assert_allclose(before[2], after[2], rtol=1e-9)


coordinate = st.floats(0, 1)


@given(coordinate, coordinate)
def test_the_square_comes_back_from_the_disc(x: float, y: float) -> None:
    square = np.array([[x, y]])
    disc = square_to_disc(square)
    assert np.hypot(*disc[0]) <= 1 + 1e-12
    np.testing.assert_allclose(disc_to_square(disc), square, atol=1e-9)


# Environment images


def test_drawn_densities_are_those_of_the_directions_drawn() -> None:
    """The mean of 1/density is the sphere's area where the whole image shines; that of f/density is f's integral."""
    image = EnvironmentImage(paint() + 0.05)
    directions, density = image.draw(sample_unit_square("sobol", COUNT, 3))
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1, atol=1e-12)
    assert (1 / density).mean() == pytest.approx(4 * np.pi, rel=5e-3)
    # Against a regular grid of directions.
    y, x = (np.mgrid[:512, :1024] + 0.5) * (np.pi / 512)
    grid = np.stack([-np.sin(y) * np.sin(x), np.cos(y), np.sin(y) * np.cos(x)], axis=-1).reshape(-1, 3)
    integral = (image.look_up(grid) * np.sin(y).reshape(-1, 1)).sum(axis=0) * (np.pi / 512) ** 2
    np.testing.assert_allclose((image.look_up(directions) / density[:, None]).mean(axis=0), integral, rtol=5e-3)
    assert image.flux == pytest.approx(integral @ LUMINANCE, rel=5e-3)


def test_only_what_shines_is_drawn() -> None:
    """One texel of 512; nothing farther than a texel away, where the image is black, and nearly all of even weight."""
    pixels = np.zeros((16, 32, 3), np.float32)
    pixels[5, 20] = 1
    image = EnvironmentImage(pixels)
    directions, density = image.draw(sample_unit_square("sobol", 4096, 0))
    radiance = image.look_up(directions)
    assert (radiance > 0).all()
    assert (radiance @ LUMINANCE / density).mean() == pytest.approx(image.flux, rel=0.01)


def test_a_black_image_brings_nothing() -> None:
    light = Environment(image=np.zeros((2, 4, 3)))
    assert light.measure_flux(BOUNDS) == 0
    _, directions, carried = emit(light)
    assert np.isfinite(directions).all()
    assert (carried == 0).all()


def test_the_middle_turns_to_the_left() -> None:
    """The middle of the image lies at -z, its right half begins at +x; at 90 degrees the middle lies at -x."""
    pixels = np.zeros((8, 32, 3), np.float32)
    pixels[:, 15:17] = 1
    pixels[:, 23:25, 0] = 0.25
    middle, right = [[0.0, 0.0, -1.0]], [[1.0, 0.0, 0.0]]
    plain, turned = Environment(image=pixels), Environment(image=pixels, rotation=90.0)
    assert plain.look_up(np.array(middle)).tolist() == [[1, 1, 1]]
    np.testing.assert_allclose(plain.look_up(np.array(right)), [[0.25, 0, 0]], atol=1e-9)
    np.testing.assert_allclose(turned.look_up(np.array([[-1.0, 0.0, 0.0]])), [[1, 1, 1]], atol=1e-9)
    np.testing.assert_allclose(turned.look_up(np.array(middle)), [[0.25, 0, 0]], atol=1e-9)
    _, directions, carried = emit(turned)
    mean = (carried[:, 1:2] * -directions).sum(axis=0)
    np.testing.assert_allclose(mean / np.linalg.norm(mean), (-1, 0, 0), atol=0.02)


# Several lights together


def test_rays_are_dealt_without_a_bias_however_small_the_share() -> None:
    lights = [Point((0, 0, 0), (v, v, v)) for v in (100.0, 1.0, 0.02, 0.0)]
    carried, seeds = np.zeros(4), 4000
    for seed in range(seeds):
        taken = 0
        for light, part, factor in deal_rays(lights, BOUNDS, 16, seed):
            taken += part.stop - part.start
            carried[lights.index(light)] += factor * light.measure_flux(BOUNDS)
        assert taken == 16
    flux = np.array([light.measure_flux(BOUNDS) for light in lights])
    np.testing.assert_allclose(carried[:2] / seeds, flux[:2], rtol=0.06)
    assert carried[2] / seeds == pytest.approx(flux[2], rel=0.6)  # chosen about 13 times
    assert carried[3] == 0


@given(st.lists(st.floats(1e-3, 1e3), min_size=1, max_size=8), st.integers(1, 64), st.integers(0, 99))
def test_each_light_gets_its_share_rounded_up_or_down(powers: list[float], count: int, seed: int) -> None:
    lights = [Point((float(i), 0, 0), (v, v, v)) for i, v in enumerate(powers)]
    given_rays = {light.position: part for light, part, _ in deal_rays(lights, BOUNDS, count, seed)}
    assert sum(part.stop - part.start for part in given_rays.values()) == count
    for light, power in zip(lights, powers, strict=True):
        part = given_rays.get(light.position, slice(0, 0))
        assert abs((part.stop - part.start) - power / sum(powers) * count) < 1 + 1e-9


def test_several_lights_keep_their_vpls_and_maps() -> None:
    scene = room()
    lights: Any = [
        scene.lights[0],
        replace(scene.lights[0], position=(0.5, 0.8, 0.1)),
        Point((-0.5, 0.2, 0.4), (1.0, 1.0, 1.0)),
    ]
    kept, tracer = KeptVpls(96, seed=1), Tracer(scene)
    first = kept.update(lights, tracer, least=0, most=96)
    assert first.kept.all()
    assert 80 < len(first.vpls) <= 96
    assert len(np.unique(first.vpls.ray)) == len(first.vpls)
    assert first.vpls.ray.max() < 96
    again = kept.update(lights, tracer, least=0, most=96)
    np.testing.assert_array_equal(again.versions, first.versions)
    np.testing.assert_array_equal(again.vpls.position, first.vpls.position)
    assert kept.at_rest
    brighter = kept.update(
        [lights[0], lights[1], replace(lights[2], intensity=(9.0, 9.0, 9.0))], tracer, least=0, most=96
    )
    np.testing.assert_array_equal(brighter.versions, first.versions)
    assert brighter.vpls.emission.sum() > first.vpls.emission.sum()
    moved = kept.update(
        [lights[0], lights[1], replace(lights[2], position=(-0.5, 0.2, 0.41))], tracer, least=0, most=96
    )
    own = first.vpls.ray < first.vpls.ray[-1] - 60  # some of the first light's
    assert own.any()
    np.testing.assert_array_equal(moved.versions[: own.sum()], first.versions[: own.sum()])
