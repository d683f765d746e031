"""Shadow maps where they are easily wrong: lights on surfaces and in closed boxes, bad triangles, extreme sizes."""

from __future__ import annotations

from dataclasses import replace
from importlib import import_module

import numpy as np
import pytest
from fixed_lights import lit_by, vpl_records
from map_rays import tiles, wrong_texels
from small_scenes import Mesh, box, build, plane, quad, room, scaled

from deferred_ir.base.errors import DeviceError, GraphError
from deferred_ir.rays.tracer import Tracer
from deferred_ir.scene.camera import Camera
from deferred_ir.scene.lights.spotlight import Spotlight

visibility = import_module("deferred_ir.profiling.checks.visibility")

PROJECTIONS = ["perspective", "paraboloid"]
SIZE = (64, 64)
SMALL = {"shadow_maps.spot_size": 256, "shadow_maps.vpl_size": 64}


@pytest.fixture(params=PROJECTIONS)
def projection(request):
    return request.param


@pytest.fixture
def maps(renderer, tmp_path, projection):
    """The maps of VPLs at chosen places, each with its record."""

    def draw(scene, position, normal, fov=150.0, **settings):
        lights = vpl_records(position, normal, np.ones((len(position), 3)), fov=fov)
        chosen = {**SMALL, "shadow_maps.projection": projection, **settings}
        one = lit_by(renderer, tmp_path, lights, (16, 16), "deferred", set=chosen)
        one.render(scene)
        return tiles(one, len(lights)), lights

    return draw


@pytest.fixture
def judged(renderer, projection):
    """Pairs of a pixel and a light, what the map says of them and what the ray."""

    def draw(scene, lights="vpls", **settings):
        chosen = {**SMALL, "shadow_maps.projection": projection, "vpl.count": 64, **settings}
        one = renderer(SIZE, visibility.GRAPH, set=chosen, passes=visibility.PASSES)
        plan = one.plan(scene, outputs=[visibility.name_output(lights)])
        one.draw(scene, plan, seed=1)
        pairs = visibility.trace_pairs(one, scene, lights)
        assert len(pairs.light) > 300
        assert np.isfinite(pairs.shown).all()
        return pairs

    return draw


def mismatch(pairs):
    return ((pairs.shown >= 0.5) != pairs.lit).mean()


# Triangles


def split_into_slivers(mesh: Mesh, width: float) -> Mesh:
    """Each triangle in three, about a point that is `width` of its height from the first edge."""
    positions, faces = [*np.asarray(mesh.positions)], []
    for a, b, c in mesh.faces:
        corners = [positions[i] for i in (a, b, c)]
        positions.append(((1 - width) * (corners[0] + corners[1]) / 2) + width * corners[2])
        p = len(positions) - 1
        faces += [(a, b, p), (b, c, p), (c, a, p)]
    return Mesh(np.array(positions), np.array(faces), mesh.albedo)


LIGHTS_IN_ROOM = np.array([(0.1, 0.2, 0.3), (-0.7, 0.8, 0.1), (0.6, -0.9, -0.6), (0.05, 0.9, 0.9)])
AXES = np.array([(0.2, -1.0, 0.1), (1.0, -0.5, 0.2), (-0.5, 1.0, 0.6), (0.0, -0.1, -1.0)])


TURN = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))[0]
"""Nothing lies along an axis, so all coordinates have roundings."""


def meshes(turn=TURN):
    whole = box((-1, -1, -1), (1, 1, 1)), box((-0.2, -1, -0.5), (0.3, -0.3, 0.0))
    return [replace(mesh, positions=mesh.positions @ turn) for mesh in whole]


def assert_same_maps(some, others, share=0.002):
    for one, other in zip(some, others, strict=True):
        assert (np.abs(one - other) > 0.03 * np.maximum(one, other)).mean() <= share


@pytest.mark.parametrize("width", [1e-3, 1e-6, 0.0])
def test_slivers_leave_no_gap(maps, width):
    """Up to a millionth as wide as long, and without any width; the point lies in the air of no other edge."""
    whole, _ = maps(build(*meshes()), LIGHTS_IN_ROOM @ TURN, AXES @ TURN)
    slivers, _ = maps(
        build(*(split_into_slivers(mesh, width) for mesh in meshes())), LIGHTS_IN_ROOM @ TURN, AXES @ TURN
    )
    assert_same_maps(slivers, whole)


def test_triangles_without_area_cover_nothing(maps):
    rng = np.random.default_rng(4)
    ends = rng.uniform(-0.9, 0.9, (40, 2, 3))
    along = rng.uniform(0, 1, (40, 1))
    needle = np.stack([ends[:, 0], ends[:, 1], ends[:, 0] * (1 - along) + ends[:, 1] * along], axis=1)
    point = np.repeat(ends[:20, :1], 3, axis=1)
    twice = np.stack([ends[:20, 0], ends[:20, 1], ends[:20, 0]], axis=1)
    flat = np.concatenate([needle, point, twice]).reshape(-1, 3)
    with_flat = build(*meshes(), Mesh(flat, np.arange(len(flat)).reshape(-1, 3)))
    assert_same_maps(
        maps(with_flat, LIGHTS_IN_ROOM @ TURN, AXES @ TURN)[0],
        maps(build(*meshes()), LIGHTS_IN_ROOM @ TURN, AXES @ TURN)[0],
    )


def test_faces_that_lie_in_one_another_are_as_one(maps, judged):
    """Each twice, the second time the other way round, and a tile on the floor in the floor's own plane."""
    single = meshes(np.eye(3))
    twice = [Mesh(mesh.positions, np.concatenate([mesh.faces, mesh.faces[:, ::-1]])) for mesh in single]
    floor = quad((-0.5, -1, 0.9), (0.5, -1, 0.9), (0.5, -1, 0.3))
    view = {"camera": room().camera, "spotlight": room().spotlight}
    scene, plain = build(*twice, floor, **view), build(*single, **view)
    assert_same_maps(maps(scene, LIGHTS_IN_ROOM, AXES)[0], maps(plain, LIGHTS_IN_ROOM, AXES)[0], share=0)
    assert mismatch(judged(scene)) < mismatch(judged(plain)) + 0.005


@pytest.mark.parametrize("tilt", [0.0, 1e-7, 1e-3, 0.3])
def test_triangles_through_the_lights_own_plane(maps, projection, tilt):
    """One above the light, and two through its plane, with corners on both sides and nearly on it."""
    above = Mesh([(-3, 0.5, -4), (4, 0.5, -3), (0, 0.5, 4)], [[0, 1, 2]])
    upright = Mesh([(-3, -2, 1), (3, -2, 1), (0, 2, 1)], [[0, 1, 2]])
    nearly = Mesh([(-1, 0.7, -2), (-1, tilt, 3), (-1.5, -tilt, 3)], [[0, 1, 2]])
    scene = build(above, upright, nearly)
    found, lights = maps(scene, [(0.0, 0.0, 0.0)], [(0.0, 1.0, tilt)])
    off = wrong_texels(Tracer(scene), lights[0], found[0], projection)
    assert off.mean() < 0.001


# Where lights are

CORNERS = [(-1, -1, -1), (1, 1, 1), (-0.999, -0.999, -0.999), (-1, 0.2, 0.3), (-0.999, 0.2, 0.3), (0.0, 0.0, 0.0)]
"""Of the room: corners, a millimetre off one, on a wall, a millimetre off it, in its middle."""


@pytest.mark.parametrize("place", CORNERS, ids=str)
def test_a_light_anywhere_in_a_closed_box_sees_all_of_it(maps, projection, place):
    """Into the box, along its diagonal and along an axis: the map holds the walls everywhere."""
    scene = build(box((-1, -1, -1), (1, 1, 1)))
    inwards = -np.sign(np.round(place)) if np.any(np.round(place)) else np.array([0, 0, 1])
    into = np.array([inwards, np.where(np.arange(3) == 0, np.where(inwards[0] == 0, 1, inwards[0]), 0)], float)
    found, lights = maps(scene, [place, place], into)
    for tile, light in zip(found, lights, strict=True):
        assert wrong_texels(Tracer(scene), light, tile, projection).mean() < 0.001


PARABOLOID = [("paraboloid", 140.0), ("paraboloid", 179.9)]
"""Planar maps as wide have too few texels in the middle (docs/limits.md)."""
IN_BOX = Spotlight((0.2, 0.6, -0.1), (0.0, -1.0, 0.0), 130.0, (5.0, 5.0, 5.0))


@pytest.mark.parametrize("graph", ["deferred", "forward"])
@pytest.mark.parametrize(("projection", "fov"), [("perspective", 140.0), *PARABOLOID])
def test_nothing_leaves_a_closed_box(renderer, projection, graph, fov):
    """Light and VPLs inside; the camera outside sees the box and the floor around it.

    Half a texel at the hemisphere's rim has no neighbour to be blended with; what it lets out is next to nothing.
    """
    view = Camera((2.0, 2.5, 5.0), (0.0, -0.5, 0.0), fov=70.0)
    scene = build(box((-1, -1, -1), (1, 1, 1)), plane(6.0, -1.6), camera=view, spotlight=IN_BOX)
    inside = replace(scene, camera=Camera((0.0, 0.0, 0.9), (0.0, 0.0, 0.0), fov=80.0))
    chosen = {"shadow_maps.vpl_size": 128, "shadow_maps.projection": projection, "vpl.fov": fov}
    one = renderer(SIZE, graph, set={**SMALL, **chosen})
    left, kept = (one.render(each, vpls=32).radiance for each in (scene, inside))
    assert kept.min() > 0
    assert left.max() <= (1e-3 if fov > 170 else 0) * kept.mean()


@pytest.mark.parametrize(("projection", "fov"), [("perspective", 100.0), ("perspective", 150.0), *PARABOLOID])
def test_all_of_a_closed_box_is_lit_from_inside(judged, projection, fov):
    """VPLs on all its walls: nothing lies between two of them, but for rays that all but graze a wall."""
    view = Camera((0.5, 0.4, 0.95), (0.0, 0.0, 0.0), fov=90.0)
    pairs = judged(build(box((-1, -1, -1), (1, 1, 1)), camera=view, spotlight=IN_BOX), **{"vpl.fov": fov})
    assert pairs.lit.mean() > 0.999
    assert (pairs.shown >= 0.5).mean() > 0.98
    assert pairs.irradiance @ pairs.shown > 0.98 * pairs.irradiance.sum()


@pytest.mark.parametrize("fov", [1.0, 60.0, 139.0, 141.0, 179.0])
def test_spotlights_of_any_width(judged, fov):
    """A card covers half of the cone's floor."""
    light = Spotlight((0.0, 2.0, 0.0), (0.0, 0.0, 0.0), fov)
    view = Camera((-0.3, 0.6, 0.3), (0.0, 0.0, 0.0), fov=min(fov * 4, 100.0))
    card = quad((0.002, 1, 0.5), (0.5, 1, 0.5), (0.5, 1, -0.5))
    pairs = judged(build(plane(), card, camera=view, spotlight=light), "spotlight", **{"shadow_maps.spot_size": 512})
    assert 0.1 < pairs.lit.mean() < 0.9
    assert mismatch(pairs) < 0.01


def test_vpls_as_narrow_as_can_be(judged):
    """A degree, from a spot on the floor to the ceiling, half of which a card behind the spotlight covers."""
    light = Spotlight((0.0, 1.9, 0.0), (0.0, 0.0, 0.0), 2.0)
    view = Camera((-0.2, 2.7, 0.0), (0.0, 3.0, 0.0), fov=12.0)
    ceiling = quad((-1, 3, -1), (1, 3, -1), (1, 3, 1))
    card = quad((0.002, 2.5, 0.5), (0.5, 2.5, 0.5), (0.5, 2.5, -0.5))
    scene = build(plane(), ceiling, card, camera=view, spotlight=light)
    pairs = judged(scene, **{"vpl.fov": 1.0})
    assert 0.1 < pairs.lit.mean() < 0.9
    assert mismatch(pairs) < 0.02


def test_vpls_as_wide_as_can_be(judged, projection):
    """A planar map of 179.9 degrees is of little use (docs/limits.md), but what it says is defined."""
    assert mismatch(judged(room(), **{"vpl.fov": 179.9})) < (0.03 if projection == "paraboloid" else 0.6)


@pytest.mark.parametrize("factor", [1e-3, 1e3])
def test_the_unit_of_length_does_not_matter(judged, factor):
    """The same pairs, of which but a few lie so near an edge that rounding decides."""
    one, other = (judged(scene, **{"vpl.pattern": "sobol"}) for scene in (room(), scaled(room(), factor)))
    assert len(other.light) == pytest.approx(len(one.light), rel=0.005)
    assert mismatch(other) == pytest.approx(mismatch(one), abs=0.003)
    lit = [pairs.irradiance @ pairs.shown / pairs.irradiance.sum() for pairs in (one, other)]
    assert lit[1] == pytest.approx(lit[0], abs=0.003)


# Sizes


@pytest.mark.parametrize("fov", [60.0, 150.0, 179.0])
def test_maps_of_sixteen_texels(judged, fov):
    """Coarse, but not wrong: what they say of most pairs is right."""
    sizes = {"shadow_maps.spot_size": 16, "shadow_maps.vpl_size": 16}
    assert mismatch(judged(room(), "spotlight", **sizes)) < 0.1
    pairs = judged(room(), **sizes, **{"vpl.fov": min(fov, 150.0)})
    assert mismatch(pairs) < 0.15


@pytest.mark.parametrize("graph", ["deferred", "forward"])
@pytest.mark.parametrize("name", ["spot_size", "vpl_size"])
def test_a_map_larger_than_the_driver_draws_is_one_line(renderer, monkeypatch, projection, graph, name):
    sizes = {"shadow_maps.spot_size": 64, "shadow_maps.vpl_size": 64, f"shadow_maps.{name}": 512}
    one = renderer((32, 32), graph, set={**sizes, "shadow_maps.projection": projection})
    monkeypatch.setitem(one.gpu.__dict__, "max_size", 256)
    with pytest.raises(
        DeviceError, match=rf"512x512 pixels, and this driver draws at most 256; use a smaller shadow_maps\.{name}$"
    ):
        one.render(room(), vpls=4)


def test_a_map_as_large_as_the_driver_draws(renderer, monkeypatch, projection):
    one = renderer((32, 32), set={**SMALL, "shadow_maps.projection": projection})
    monkeypatch.setitem(one.gpu.__dict__, "max_size", 256)
    assert one.render(room(), vpls=4).radiance.max() > 0


@pytest.mark.parametrize("graph", ["deferred", "forward"])
def test_more_lights_than_the_budget_holds_says_how_many_fit(renderer, projection, graph):
    chosen = {"shadow_maps.projection": projection, "shadow_maps.budget": 20}
    with pytest.raises(GraphError, match=r"(\d+) VPLs fit, .* use fewer, a smaller shadow_maps.vpl_size") as raised:
        renderer(SIZE, graph, set=chosen).plan(room(), 1000)
    fits = int(str(raised.value).split("; ")[1].split()[0])
    assert renderer(SIZE, graph, set=chosen).plan(room(), fits)
    with pytest.raises(GraphError, match=f"{fits} VPLs fit"):
        renderer(SIZE, graph, set=chosen).plan(room(), fits + 1)


def test_more_lights_than_there_are_layers_says_how_many_fit(renderer, projection):
    """2048 layers are what every driver has: one for the spotlight, the others with four tiles each."""
    sizes = {"shadow_maps.spot_size": 32, "shadow_maps.vpl_size": 16, "shadow_maps.projection": projection}
    one = renderer((32, 32), set=sizes)
    assert one.plan(room(), 4 * 2047)
    with pytest.raises(GraphError, match=r"8188 VPLs fit") as raised:
        one.plan(room(), 4 * 2047 + 1)
    assert "\n" not in str(raised.value)
