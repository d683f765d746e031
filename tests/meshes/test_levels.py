"""Levels of detail for the maps of VPLs: chunks fit together, and no map is coarser than its texels."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from equivalence import assert_equivalent, hit_pixels, render_both
from fixed_lights import vpl_records
from small_scenes import box, build, room, scaled, sphere

from deferred_ir.base.errors import GraphError
from deferred_ir.meshes import levels as detail
from deferred_ir.scene.camera import Camera
from deferred_ir.scene.lights.spotlight import Spotlight
from deferred_ir.shadows.settings import MapParams


@pytest.fixture(scope="module")
def balls():
    """Make a room with fine spheres, of which the farther ones need not be drawn in full detail."""
    meshes = [box((-1, -1, -1), (1, 1, 1))]
    for centre in ((-0.6, -0.7, -0.6), (0.5, -0.6, 0.0), (0.1, -0.2, -0.7)):
        ball = sphere(0.25, 3)
        meshes.append(replace(ball, positions=ball.positions + centre))
    return build(
        *meshes,
        camera=Camera((0.1, 0.2, 0.95), (0.0, -0.2, -0.5), fov=75.0),
        spotlight=Spotlight((-0.4, 0.9, 0.3), (0.1, -1.0, -0.1), 90.0, (3.0, 2.5, 2.0)),
    )


def lights(count=40, fov=150.0):
    rng = np.random.default_rng(3)
    return vpl_records(rng.uniform(-1, 1, (count, 3)), rng.normal(size=(count, 3)), np.ones((count, 3)), fov=fov)


def clusters(scene, params):
    return detail.LevelClusters(detail.make_mesh(scene.geometry), detail.find_levels(scene.geometry), params.tolerance)


@pytest.mark.parametrize("projection", ["perspective", "paraboloid"])
def test_each_light_draws_each_chunk_at_one_level_that_it_may(balls, projection):
    params = MapParams(vpl_deviation=1.0, vpl_size=64, projection=projection)
    found, levels, records = clusters(balls, params), detail.find_levels(balls.geometry), lights()
    drawn = found.find_drawn(records)
    half = math.radians(75)
    texel = 2 * math.tan(half) / 64 if projection == "perspective" else 4 * math.tan(half / 2) / 64
    chosen = set()
    for light, row in zip(records, drawn, strict=True):
        faces = np.concatenate([found.order[found.starts[c] : found.starts[c + 1]] for c in np.flatnonzero(row)])
        pairs = np.unique(np.stack([levels.chunk[faces], levels.level[faces]]), axis=1)
        assert pairs[0].tolist() == list(range(levels.boxes.shape[1]))
        # No vertex is nearer than the level's deviation allows.
        distance = np.linalg.norm(balls.geometry.positions[levels.faces[faces]] - light["position"], axis=2).min(axis=1)
        assert (levels.deviations[levels.level[faces]] <= texel * distance * (1 + 1e-5)).all()
        chosen |= set(pairs[1].tolist())
    assert len(chosen) > 2


def test_chunks_of_any_levels_leave_no_gap(balls):
    """Every edge belongs to two triangles, or more where chunks meet, whichever level each chunk has."""
    levels, rng = detail.find_levels(balls.geometry), np.random.default_rng(0)
    for _ in range(8):
        choice = rng.integers(len(levels.deviations), size=levels.boxes.shape[1])
        faces = levels.faces[choice[levels.chunk] == levels.level]
        edges = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
        assert (np.unique(edges, axis=0, return_counts=True)[1] % 2 == 0).all()


def test_levels_are_made_once(balls):
    assert detail.find_levels(balls.geometry) is detail.find_levels(replace(balls, name="again").geometry)


def test_units_do_not_matter(balls):
    large = scaled(balls, 1024.0)
    one, other = (np.bincount(detail.find_levels(scene.geometry).level) for scene in (balls, large))
    np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("projection", ["perspective", "paraboloid"])
def test_forward_and_deferred_draw_the_same(renderer, balls, projection):
    chosen = {"shadow_maps.vpl_deviation": 4.0, "shadow_maps.projection": projection}
    deferred, forward = render_both(renderer, balls, chosen)
    assert_equivalent(deferred, forward, hit_pixels("balls", balls))


def test_only_one_mesh_can_stand_in(renderer):
    settings = {"projection": "paraboloid", "tessellation": "pre", "vpl_deviation": 0.5}
    one = renderer((16, 16), set={f"shadow_maps.{name}": value for name, value in settings.items()})
    with pytest.raises(GraphError, match=r"vpl_deviation and shadow_maps\.tessellation.*set vpl_deviation = 0 or"):
        one.render(room(), vpls=4)


@pytest.mark.parametrize("projection", ["perspective", "paraboloid"])
def test_a_texel_hardly_shows_and_many_do(renderer, balls, projection):
    """Indirect light is compared with that of maps which draw the full scene."""
    images = [
        renderer((64, 64), set={"shadow_maps.vpl_deviation": most, "shadow_maps.projection": projection})
        .render(balls, vpls=32)
        .radiance
        for most in (0.0, 0.5, 16.0)
    ]
    little, much = (np.abs(image - images[0]).mean() / images[0].mean() for image in images[1:])
    assert 0 < little < 2e-4
    assert much > 3 * little
    direct = [
        renderer((64, 64), set={"shadow_maps.vpl_deviation": m}).render(balls, vpls=0).radiance for m in (0.0, 16.0)
    ]
    np.testing.assert_array_equal(*direct)
