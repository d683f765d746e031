"""What lights do to a plane, pixel by pixel against closed forms, and how images of many lights hang together."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from fixed_lights import lit_by, vpl_records
from small_scenes import build, plane, quad, sphere

from deferred_ir.rays.tracer import Tracer
from deferred_ir.scene.camera import Camera
from deferred_ir.scene.lights.spotlight import Spotlight

SIZE = (96, 72)
GRAPHS = ("deferred", "forward")
ALBEDO = (0.5, 0.25, 0.125)  # exact in half floats
DARK = (0.0, 0.0, 0.0)


def floor(fov: float = 80.0, height: float = 1.5) -> object:
    """A plane at y = 0 seen at a slant, with background around it, lit from `height`."""
    return build(
        plane(2.0, albedo=ALBEDO),
        camera=Camera((0.3, 2.5, 3.5), (0.0, 0.0, 0.0), fov=60.0),
        spotlight=Spotlight((0.2, height, -0.3), (-0.1, 0.0, 0.2), fov, (3.0, 2.0, 1.0)),
    )


def seen(scene):
    """Positions (H, W, 3) under the pixels, and which pixels show something."""
    rays = scene.camera.rays(SIZE).reshape(-1, 3)
    hits = Tracer(scene).closest(np.broadcast_to(scene.camera.position, rays.shape), rays)
    return hits.position.reshape(SIZE[1], SIZE[0], 3), hits.hit.reshape(SIZE[1], SIZE[0])


def eroded(mask):
    """Pixels whose four neighbours belong to `mask`, too: a centre may lie exactly on a silhouette."""
    inner = mask.copy()
    for axis in (0, 1):
        for step in (-1, 1):
            inner &= np.roll(mask, step, axis)
    return inner


def spot_radiance(scene, positions):
    """rho/pi E cos(theta) cone(theta) cos_x / d^2 on a floor."""
    light = scene.spotlight
    way = positions - light.position
    distance = np.linalg.norm(way, axis=-1)
    towards = way / distance[..., None]
    intensity = np.maximum(towards @ light.axis, 0) * light.cone(towards)
    return (
        (intensity * np.maximum(-towards[..., 1], 0) / distance**2)[..., None]
        * np.array(ALBEDO)
        * light.emission
        / np.pi
    )


@pytest.mark.parametrize("graph", GRAPHS)
@pytest.mark.parametrize("fov", [10.0, 80.0, 170.0])
def test_the_spotlight_on_a_floor(renderer, graph, fov):
    scene = floor(fov)
    radiance = renderer(SIZE, graph).render(scene, vpls=0).radiance
    positions, shown = seen(scene)
    expected = spot_radiance(scene, positions)
    assert expected[shown].max() > 0.1
    inside, background = eroded(shown), eroded(~shown)
    np.testing.assert_allclose(radiance[inside], expected[inside], rtol=1e-4, atol=1e-5 * expected[shown].max())
    assert background.sum() > 100
    assert (radiance[background] == 0).all()


def test_a_very_narrow_spotlight_keeps_its_soft_edge(renderer):
    """Half a degree, from far above: cosines in single precision would show steps."""
    scene = floor(0.5, height=150.0)
    light = replace(scene.spotlight, position=(0.1, 150.0, 0.2), look_at=(0.0, 0.0, 0.0), emission=(3e4, 3e4, 3e4))
    scene = replace(scene, lights=(light,), camera=Camera((0.0, 1.5, 0.4), (0.0, 0.0, 0.0), fov=60.0))
    radiance = renderer(SIZE, "deferred").render(scene, vpls=0).radiance
    positions, shown = seen(scene)
    expected = spot_radiance(scene, positions)
    edge = shown & (expected[..., 0] < 0.99 * expected[..., 0].max()) & (expected[..., 0] > 0)
    assert edge.sum() > 300
    np.testing.assert_allclose(radiance[shown], expected[shown], atol=1e-3 * expected.max())


@pytest.mark.parametrize("graph", GRAPHS)
@pytest.mark.parametrize(("fov", "clamp"), [(150.0, 0.0), (60.0, 0.0), (179.0, 0.0), (150.0, 1.2)])
def test_a_vpl_on_a_floor(renderer, tmp_path, graph, fov, clamp):
    scene = floor()
    position, normal, emission = np.array([0.2, 0.7, 0.1]), np.array([0.1, -1.0, 0.3]), np.array([0.5, 1.0, 2.0])
    records = vpl_records([position], [normal], [emission], fov=fov, clamp=clamp)
    radiance = lit_by(renderer, tmp_path, records, SIZE, graph, dark=True).render(scene).radiance
    positions, shown = seen(scene)
    way = positions - position
    square = (way**2).sum(axis=-1)
    cos_y = way @ (normal / np.linalg.norm(normal)) / np.sqrt(square)
    cos_x = position[1] / np.sqrt(square)
    lit = cos_y > np.cos(np.radians(fov / 2))
    form = np.where(lit, cos_y * cos_x / np.maximum(square, clamp**2), 0)
    expected = form[..., None] * np.array(ALBEDO) * emission / np.pi
    sure = eroded(shown) & (np.abs(cos_y - np.cos(np.radians(fov / 2))) > 1e-4)
    assert sure.sum() > 0.9 * shown.sum()
    assert (expected[sure] > 0).any()
    if fov < 100:
        assert (expected[sure] == 0).any()
    np.testing.assert_allclose(radiance[sure], expected[sure], rtol=1e-4, atol=1e-6 * expected.max())


@pytest.mark.parametrize("graph", GRAPHS)
def test_the_clamp_spares_the_spotlight(renderer, tmp_path, graph):
    scene, dark = floor(), vpl_records([(0, 1, 0)], [(0, -1, 0)], [DARK], clamp=10.0)
    clamped = lit_by(renderer, tmp_path, dark, SIZE, graph).render(scene).radiance
    np.testing.assert_array_equal(clamped, renderer(SIZE, graph).render(scene, vpls=0).radiance)


@pytest.mark.parametrize("graph", GRAPHS)
def test_light_from_behind_a_face_does_not_shine_through(renderer, tmp_path, graph):
    scene = floor()
    records = vpl_records([(0, -0.5, 0)], [(0, 1, 0)], [(1, 1, 1)])
    assert lit_by(renderer, tmp_path, records, SIZE, graph, dark=True).render(scene).radiance.max() == 0


UNSHADOWED = {
    "deferred": """
[outputs]
radiance = "lighting.radiance"
[passes.lights]
[passes.vpl]
[passes.gbuffer]
[passes.lighting.inputs]
lights = "lights.lights"
vpls = "vpl.vpls"
depth = "gbuffer.depth"
normals = "gbuffer.normals"
albedo = "gbuffer.albedo"
""",
    "forward": """
[outputs]
radiance = "forward.radiance"
[passes.lights]
[passes.vpl]
[passes.visible_faces]
[passes.forward.inputs]
lights = "lights.lights"
vpls = "vpl.vpls"
primitives = "visible_faces.primitives"
depth = "visible_faces.depth"
""",
}


@pytest.mark.parametrize("graph", GRAPHS)
@pytest.mark.parametrize(("normal", "way"), [((0.9, 0.3, 0), (-1, 0.2, 0)), ((0.9, 0.3, 0), (1, -0.2, 0))])
def test_light_must_come_from_before_both_the_face_and_its_shading_normal(renderer, tmp_path, graph, normal, way):
    """A floor whose normals lean: light from one side is behind the normal, from the other behind the face.

    Drawn without shadow maps, which would hide the second.
    """
    (tmp_path / "unshadowed.toml").write_text(UNSHADOWED[graph])
    leaning = replace(plane(0.5, albedo=ALBEDO), normals=np.tile(normal / np.linalg.norm(normal), (4, 1)))
    scene = build(leaning, camera=Camera((0.0, 2.0, 0.1), (0.0, 0.0, 0.0), fov=30.0))
    one = renderer(SIZE, tmp_path / "unshadowed.toml")

    def lit(way):
        position = tuple(3.0 * np.array(way))
        return one.render(replace(scene, lights=(Spotlight(position, (0, 0, 0), 60.0),)), vpls=0).radiance.max()

    assert lit(way) == 0
    assert lit((1, 0.2, 0)) > 0


@pytest.mark.parametrize("graph", GRAPHS)
def test_coincident_faces_are_lit_once(renderer, graph):
    scene = floor()
    twice = build(plane(2.0, albedo=ALBEDO), plane(2.0, albedo=ALBEDO), camera=scene.camera, spotlight=scene.spotlight)
    one = renderer(SIZE, graph)
    np.testing.assert_array_equal(one.render(twice, vpls=8).radiance, one.render(scene, vpls=8).radiance)


# Shadows

OCCLUDER = quad((-0.25, 0.75, 0.25), (0.25, 0.75, 0.25), (0.25, 0.75, -0.25), (0.3, 0.3, 0.3))
"""A square half-way between the floor and a light at (0, 1.5, 0): its shadow is the square twice as large."""


def shadow_scene():
    return build(
        plane(2.0, albedo=ALBEDO),
        OCCLUDER,
        camera=Camera((0.4, 1.4, 3.0), (0.0, 0.0, 0.0), fov=60.0),
        spotlight=Spotlight((0.0, 1.5, 0.0), (0.0, 0.0, 0.0), 80.0, (3.0, 2.0, 1.0)),
    )


def check_shadow(scene, radiance, unshadowed, texel):
    """Dark inside the square of 1 x 1, as without occluder outside, two texels of the map from its edge left out."""
    positions, shown = seen(scene)
    on_floor = shown & (np.abs(positions[..., 1]) < 1e-3)
    edge_distance = np.abs(positions[..., [0, 2]]).max(axis=-1) - 0.5
    inside, outside = on_floor & (edge_distance < -2 * texel), on_floor & (edge_distance > 2 * texel)
    assert inside.sum() > 100
    assert outside.sum() > 500
    assert (radiance[inside] == 0).all()
    np.testing.assert_allclose(radiance[outside], unshadowed[outside], rtol=1e-5, atol=1e-5 * unshadowed.max())
    assert (unshadowed[inside] > 0).all()


@pytest.mark.parametrize("graph", GRAPHS)
def test_an_occluder_shades_the_spotlight_where_it_should(renderer, graph):
    scene = shadow_scene()
    bare = build(plane(2.0, albedo=ALBEDO), camera=scene.camera, spotlight=scene.spotlight)
    one = renderer(SIZE, graph)
    texel = 2 * 1.5 * np.tan(np.radians(40)) / 2048
    check_shadow(scene, one.render(scene, vpls=0).radiance, one.render(bare, vpls=0).radiance, texel)


@pytest.mark.parametrize("graph", GRAPHS)
@pytest.mark.parametrize("tile", [0, 5, 17])
def test_an_occluder_shades_a_vpl_where_it_should_in_any_tile(renderer, tmp_path, graph, tile):
    """The light that counts stands among dark ones, which own the other tiles."""
    scene = shadow_scene()
    bare = build(plane(2.0, albedo=ALBEDO), camera=scene.camera, spotlight=scene.spotlight)
    emission = np.zeros((20, 3))
    emission[tile] = 1.0
    lights = vpl_records(np.tile((0.0, 1.5, 0.0), (20, 1)), np.tile((0.0, -1, 0), (20, 1)), emission, fov=120.0)
    lights["position"][np.arange(20) != tile] += (0.3, 0.2, -0.1)
    one = lit_by(renderer, tmp_path, lights, SIZE, graph, dark=True)
    texel = 2 * 1.5 * np.tan(np.radians(60)) / 256
    check_shadow(scene, one.render(scene).radiance, one.render(bare).radiance, texel)


# Odd places


@pytest.mark.parametrize("graph", GRAPHS)
def test_a_light_that_hits_nothing_leaves_the_direct_light(renderer, graph):
    scene = floor()
    up = replace(scene, lights=(replace(scene.spotlight, look_at=(0.2, 9.0, -0.3)),))
    one = renderer(SIZE, graph)
    assert one.render(up, vpls=16).radiance.max() == 0
    assert one.executor.counters["vpls_alive"] == 0
    assert one.executor.counters["maps_drawn"] == 0


@pytest.mark.parametrize("graph", GRAPHS)
def test_a_light_on_a_surface_and_a_camera_on_the_light_give_finite_numbers(renderer, tmp_path, graph):
    scene = floor()
    spot = Spotlight((0.3, 0.0, 0.0), (0.3, -1.0, 0.0), 120.0, (1.0, 1.0, 1.0))
    lights = vpl_records([(0.0, 0.0, 0.0), scene.camera.position], [(0, 1, 0), (0, -1, 0)], [(1, 1, 1)] * 2)
    there = replace(scene, lights=(spot,))
    image = lit_by(renderer, tmp_path, lights, SIZE, graph).render(there)
    assert np.isfinite(image.radiance).all()


@pytest.mark.parametrize("graph", GRAPHS)
def test_a_light_exactly_where_a_pixel_looks_gives_nothing_instead_of_a_division_by_zero(renderer, tmp_path, graph):
    scene = build(plane(), camera=Camera((0.0, 2.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, -1.0)))
    scene = replace(scene, lights=(Spotlight((0.0, 0.0, 0.0), (0.0, -1.0, 0.0), 120.0, (1.0, 1.0, 1.0)),))
    records = vpl_records([(0, 0, 0)], [(0, 1, 0)], [(1, 1, 1)])
    for size in ((1, 1), (3, 3)):
        image = lit_by(renderer, tmp_path, records, size, graph).render(scene)
        assert (image.radiance == 0).all()


@pytest.mark.parametrize("graph", GRAPHS)
def test_inside_a_sphere_one_vpl_lights_every_point_alike(renderer, tmp_path, graph):
    """Both ends of a chord make the same angle with it, so cos cos / d^2 = 1 / (4 R^2) for all of them."""
    radius = 3.0
    scene = build(
        sphere(radius, 5, ALBEDO),
        camera=Camera((0.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), 90.0),
        spotlight=Spotlight((0.0, 0.0, 0.0), (0.0, -1.0, 0.0), 60.0),
    )
    lights = vpl_records([(0.0, -radius, 0.0)], [(0.0, 1.0, 0.0)], [(4.0, 2.0, 1.0)])
    # Nothing is hidden in a sphere; well off their faces, no points are shaded by the maps' texels either.
    free = {"shadow_maps.vpl_offset": 3.0}
    radiance = lit_by(renderer, tmp_path, lights, SIZE, graph, set=free, dark=True).render(scene).radiance
    expected = np.array(ALBEDO) / np.pi * (4.0, 2.0, 1.0) / (4 * radius**2)
    # The facets stand up to 1e-3 inside the sphere.
    np.testing.assert_allclose(radiance, np.broadcast_to(expected, radiance.shape), rtol=5e-3)
