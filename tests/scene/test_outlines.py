"""The lines that stand for lights: where they are, and which way they shine."""

from __future__ import annotations

import numpy as np
import pytest

from deferred_ir.scene.environment_image import EnvironmentImage
from deferred_ir.scene.lights.base import Bounds
from deferred_ir.scene.lights.directional import Directional
from deferred_ir.scene.lights.disc import Disc
from deferred_ir.scene.lights.environment import Environment
from deferred_ir.scene.lights.kinds import find_kinds
from deferred_ir.scene.lights.point import Point
from deferred_ir.scene.lights.rect import Rect
from deferred_ir.scene.lights.sphere import Sphere
from deferred_ir.scene.lights.spot import Spot
from deferred_ir.scene.lights.spotlight import Spotlight

A, B = (0.1, 0.2, 0.3), (1.0, -2.5, 0.7)
BOUNDS = Bounds((1.0, 2.0, 3.0), 5.0)
EDGE = np.stack([np.cos(np.arange(32)), np.sin(np.arange(32))], axis=1)
"""Places on the edge of the unit disc."""
IMAGE = np.zeros((8, 16, 3))
IMAGE[3:5, 7:9] = 1.0
LIGHTS = (
    Spotlight(A, B, 50.0, radius=0.2),
    Spot(A, B, 70.0, 30.0),
    Point(A, radius=0.2),
    Directional(A, B),
    Rect(A, B, (0.5, 1.5)),
    Disc(A, B, 0.25),
    Sphere(A, 0.25),
    Environment(EnvironmentImage(IMAGE), rotation=70.0),
)


def distances(light, points):
    """How far points (n, 3) are from the nearest of the light's lines, (n,)."""
    start, end = light.outline(BOUNDS).transpose(1, 0, 2)
    way = end - start
    along = ((points[:, None] - start) * way).sum(axis=-1) / (way * way).sum(axis=-1)
    near = start + along.clip(0, 1)[..., None] * way
    return np.linalg.norm(points[:, None] - near, axis=-1).min(axis=1)


def directions(light):
    """Unit directions from the light's middle to all ends of its lines but the middle itself."""
    way = light.outline(BOUNDS).reshape(-1, 3) - light.position
    length = np.linalg.norm(way, axis=1)
    return way[length > 1e-9] / length[length > 1e-9][:, None]


def test_every_kind_has_lines():
    assert {light.kind for light in LIGHTS} == set(find_kinds())
    for light in (*LIGHTS, Point(A), Spotlight(A, B), Spot(A, B)):
        lines = light.outline(BOUNDS)
        assert lines.shape[1:] == (2, 3)
        assert (lines[:, 0] != lines[:, 1]).any(axis=1).all()


@pytest.mark.parametrize(
    "light", [light for light in LIGHTS if not isinstance(light, Environment)], ids=lambda x: x.kind
)
def test_lines_go_where_the_light_goes(light):
    by = (3.0, -1.0, 2.0)
    np.testing.assert_allclose(light.translate(by).outline(BOUNDS), light.outline(BOUNDS) + by, atol=1e-12)


@pytest.mark.parametrize("light", [Rect(A, B, (0.5, 1.5)), Disc(A, B, 0.25)], ids=lambda x: x.kind)
def test_flat_lights_show_their_edges(light):
    assert distances(light, light.locate(EDGE)).max() < 0.02 * light.area
    assert distances(light, np.add([A], 0.3 * light.axis)).max() < 1e-9, "and which side shines"


@pytest.mark.parametrize("light", [Spotlight(A, B, 50.0), Spot(A, B, 50.0)], ids=lambda x: x.kind)
def test_a_cone_ends_where_the_light_does(light):
    cosine = directions(light) @ light.axis
    outside = np.cos(np.radians(25))
    np.testing.assert_allclose(cosine.min(), outside)
    assert np.isclose(cosine, outside).sum() >= 36
    rim = directions(light)[np.isclose(cosine, outside)]
    inside = rim + 0.1 * light.axis
    assert light.radiate(rim).max() < 1e-9
    assert light.radiate(inside / np.linalg.norm(inside, axis=1)[:, None]).min() > 0


def test_the_inner_cone_is_where_the_light_begins_to_fall():
    cosine = directions(Spot(A, B, 70.0, 30.0)) @ Spot(A, B).axis
    assert np.isclose(cosine, np.cos(np.radians(15))).sum() >= 36


@pytest.mark.parametrize("light", [Point(A, radius=0.2), Sphere(A, 0.2)], ids=lambda x: x.kind)
def test_balls_show_their_radius(light):
    lengths = np.linalg.norm(light.outline(BOUNDS) - A, axis=-1)
    assert np.isclose(lengths, 0.2).all(axis=1).sum() == 96


def test_arrows_of_a_directional_light_are_parallel():
    lines = LIGHTS[3].outline(BOUNDS)[::3]
    way = lines[:, 1] - lines[:, 0]
    np.testing.assert_allclose(way / np.linalg.norm(way, axis=1)[:, None], np.tile(LIGHTS[3].axis, (5, 1)))


def test_the_arrow_of_an_environment_points_at_the_middle_of_its_image():
    light = LIGHTS[7]
    foot, tip = light.outline(BOUNDS)[32]
    tip = tip - foot
    np.testing.assert_allclose(light.look_up(tip[None] / np.linalg.norm(tip)), 1.0)
