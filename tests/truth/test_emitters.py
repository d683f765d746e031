"""The path tracer's light of every kind against closed forms, and its two ways of sampling against each other."""

import ast
from dataclasses import fields, replace

import numpy as np
import pytest
from small_scenes import box, build, plane, quad, room, sphere, textured
from source_imports import MODULES

from deferred_ir.rays.tracer import Tracer
from deferred_ir.scene.camera import Camera
from deferred_ir.scene.lights.directional import Directional
from deferred_ir.scene.lights.disc import Disc
from deferred_ir.scene.lights.environment import Environment
from deferred_ir.scene.lights.kinds import find_kinds
from deferred_ir.scene.lights.point import Point
from deferred_ir.scene.lights.rect import Rect
from deferred_ir.scene.lights.sphere import Sphere
from deferred_ir.scene.lights.spot import Spot
from deferred_ir.scene.surfaces.materials import TextureRef
from deferred_ir.truth.path_tracer import PathTracer
from deferred_ir.truth.reference import trace_reference

ABOVE = Camera((0.0, 3.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, -1.0), fov=30.0)
ALBEDO = np.array([0.8, 0.5, 0.2])
RGB = (3.0, 2.0, 1.0)
SIZE = (12, 12)


def light_floor(*lights, spp=64, floor=None, seed=0):
    """Trace direct light on the floor y = 0. Returns the points, and irradiance over RGB with its standard error."""
    scene = replace(floor or build(plane(1.2, albedo=tuple(ALBEDO)), camera=ABOVE), lights=lights)
    tracer = PathTracer(scene, Tracer(scene), bounces=0)
    points = tracer.trace_camera_rays(SIZE).position.reshape(*SIZE, 3)
    estimate = tracer.estimate(SIZE, spp, seed)
    scale = np.pi / (ALBEDO * RGB)
    return points, estimate.direct * scale, np.sqrt(estimate.variance) * scale


def assert_is(expected, estimate, sigma, bias=1e-5):
    """All pixels and their mean lie within their errors. Of few batches the spread may come out small by chance."""
    expected = np.broadcast_to(np.asarray(expected)[..., None], estimate.shape)
    off = estimate - expected
    assert (np.abs(off) <= 5 * np.maximum(sigma, sigma.mean()) + bias * expected.max()).all()
    assert abs(off.mean()) <= 3 * np.sqrt((sigma[..., 0] ** 2).sum()) / sigma[..., 0].size + bias * expected.max()
    assert expected.max() > 0


def compute_polygon_irradiance(corners, points):
    """Return what a polygon of radiance 1 brings to points (..., 3) of a plane that faces +y (Lambert 1760)."""
    total = np.zeros(points.shape[:-1])
    for one, other in zip(corners, [*corners[1:], corners[0]], strict=True):
        a, b = one - points, other - points
        edge = np.cross(a, b)
        length = np.linalg.norm(edge, axis=-1)
        angle = np.arctan2(length, (a * b).sum(axis=-1))
        total += angle * edge[..., 1] / length / 2
    return np.abs(total)


def cosine_over_square(points, source):
    way = np.subtract(source, points)
    return way[..., 1] / np.linalg.norm(way, axis=-1) ** 3


@pytest.mark.parametrize("radius", [0.0, 0.01, 0.5])
def test_a_point_and_a_ball_of_the_same_intensity_light_a_floor_alike(radius):
    points, *found = light_floor(Point((0.3, 1.2, -0.2), RGB, radius))
    assert_is(cosine_over_square(points, (0.3, 1.2, -0.2)), *found)


def test_a_spot_is_gltfs():
    source, target = np.array([0.3, 1.2, -0.2]), np.array([0.1, 0.0, 0.1])
    points, *found = light_floor(Spot(tuple(source), tuple(target), 50.0, 20.0, RGB))
    way = (points - source) / np.linalg.norm(points - source, axis=-1, keepdims=True)
    cosine = way @ (target - source) / np.linalg.norm(target - source)
    outer, inner = np.cos(np.radians([25.0, 10.0]))
    falloff = np.clip((cosine - outer) / (inner - outer), 0, 1) ** 2
    assert 0 < (falloff == 1).sum() < (falloff > 0).sum() < falloff.size
    assert_is(falloff * cosine_over_square(points, source), *found)


@pytest.mark.parametrize("angle", [0.0, 0.5, 60.0])
def test_directional_light_brings_its_irradiance_times_the_cosine(angle):
    _, *found = light_floor(Directional((0.5, 2.0, 1.0), (0.0, 0.0, 0.0), RGB, angle))
    assert_is(np.full(SIZE, 2 / np.sqrt(0.25 + 4 + 1)), *found)


@pytest.mark.parametrize("height", [0.02, 0.7])
def test_a_disc_is_its_closed_form(height):
    points, *found = light_floor(Disc((0.1, height, 0.2), (0.1, 0.0, 0.2), 0.4, RGB), spp=256)
    square = (points[..., 0] - 0.1) ** 2 + (points[..., 2] - 0.2) ** 2
    sum_, product = height**2 + square + 0.16, 4 * 0.16 * square
    assert_is(np.pi / 2 * (1 - (height**2 + square - 0.16) / np.sqrt(sum_**2 - product)), *found)


@pytest.mark.parametrize("height", [0.05, 0.8])
def test_a_rectangle_is_lamberts_polygon(height):
    centre, axis, up = np.array([-0.2, height, 0.1]), np.array([0.0, -1.0, 0.0]), np.array([0.6, 0.0, 0.8])
    points, *found = light_floor(Rect(tuple(centre), tuple(centre + axis), (0.9, 0.3), tuple(up), RGB), spp=256)
    across = np.cross(axis, up)
    corners = [centre + a * 0.45 * across + b * 0.15 * up for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    assert_is(compute_polygon_irradiance(corners, points), *found)


def test_a_sphere_is_its_closed_form():
    points, *found = light_floor(Sphere((0.1, 0.6, 0.0), 0.5, RGB))
    assert_is(np.pi * 0.25 * cosine_over_square(points, (0.1, 0.6, 0.0)), *found)


def test_flat_lights_shine_to_one_side_and_balls_not_inside():
    up = (0.0, 2.0, 0.0)
    for dark in (
        Rect((0.0, 1.0, 0.0), up, (1.0, 1.0), (1.0, 0.0, 0.0), RGB),
        Disc((0.0, 1.0, 0.0), up, 1.0, RGB),
        Sphere((0.0, 1.0, 0.0), 5.0, RGB),
        Point((0.0, 1.0, 0.0), RGB, 5.0),
        Directional((0.0, 0.0, 0.0), up, RGB),
    ):
        assert not light_floor(dark, spp=8)[1].any()


def test_a_constant_environment_brings_pi_times_its_radiance():
    scene = build(plane(1.2, albedo=tuple(ALBEDO)), camera=replace(ABOVE, fov=60.0))
    scene = replace(scene, lights=(Environment(radiance=RGB, scale=0.5),))
    made = trace_reference(scene, (24, 24), spp=64)
    assert 0.1 < made.hit.mean() < 0.9
    np.testing.assert_allclose(
        made.emission[~made.hit], np.broadcast_to(np.array(RGB) / 2, (int((~made.hit).sum()), 3))
    )
    assert not made.emission[made.hit].any()
    assert not made.indirect.any()
    off = made.direct[made.hit] / (ALBEDO * RGB * 0.5) - 1
    assert np.abs(off).max() < 0.2
    assert abs(off.mean()) < 0.01
    np.testing.assert_allclose(made.radiance, made.direct + made.emission)


def integrate_image(look_up):
    """Return the irradiance on a plane that faces +y from an environment, by the midpoint rule."""
    polar = (np.arange(400) + 0.5) / 400 * np.pi / 2
    azimuth = (np.arange(1600) + 0.5) / 1600 * 2 * np.pi
    ring, turn = np.meshgrid(polar, azimuth, indexing="ij")
    ways = np.stack([np.sin(ring) * np.sin(turn), np.cos(ring), -np.sin(ring) * np.cos(turn)], axis=-1)
    area = np.pi / 2 / 400 * 2 * np.pi / 1600
    return (look_up(ways.reshape(-1, 3)).reshape(400, 1600) * np.cos(ring) * np.sin(ring)).sum() * area


@pytest.mark.parametrize("place", [(0, 5), (2, 3), (2, 15)], ids=["pole", "middle", "seam"])
def test_one_bright_texel_lights_a_floor_through_its_tent(place):
    pixels = np.zeros((8, 16, 3))
    pixels[place] = 4.0

    def look_up(ways):
        x = (np.arctan2(ways[:, 0], -ways[:, 2]) / (2 * np.pi) + 0.5) * 16 - 0.5
        y = np.maximum(np.arccos(ways[:, 1]) / np.pi * 8 - 0.5, 0)
        off = np.abs((x - place[1] + 8) % 16 - 8)
        return 4 * np.maximum(1 - off, 0) * np.maximum(1 - np.abs(y - place[0]), 0)

    environment = Environment(image=pixels * np.array(RGB))
    _, *found = light_floor(environment, spp=256)
    assert_is(np.full(SIZE, integrate_image(look_up)), *found, bias=1e-3)
    assert found[1].mean() < 0.05 * found[0].mean()


def test_an_environment_is_turned_as_the_design_says():
    pixels = np.zeros((64, 128, 3))
    pixels[:, 63:65] = (1.0, 0.0, 0.0)  # the middle
    pixels[:, 95:97] = (0.0, 1.0, 0.0)  # its right
    pixels[:2] = (0.0, 0.0, 1.0)  # up
    away = build(plane(0.01, -50.0))

    def look(way, rotation, up=(0.0, 1.0, 0.0)):
        camera = Camera((0.0, 0.0, 0.0), way, up, fov=1e-3)
        scene = replace(away, camera=camera, lights=(Environment(image=pixels, rotation=rotation),))
        return trace_reference(scene, (1, 1), spp=1).radiance[0, 0]

    for rotation, middle, right in ((0.0, (0, 0, -1), (1, 0, 0)), (90.0, (-1, 0, 0), (0, 0, -1))):
        np.testing.assert_allclose(look(middle, rotation), (1, 0, 0), atol=1e-3)
        np.testing.assert_allclose(look(right, rotation), (0, 1, 0), atol=1e-3)
        np.testing.assert_allclose(look((0, 1, 0), rotation, (0.0, 0.0, 1.0)), (0, 0, 1), atol=1e-3)


def make_panel(*, down=True, both=False, pixels=None):
    """Return a floor with an emitting panel above, out of the camera's sight, and the panel's corners."""
    corners = [(-0.3, 0.7, 0.4), (-0.3, 0.7, -0.2), (0.5, 0.7, -0.2), (0.5, 0.7, 0.4)]
    corners = corners[::-1] if not down else corners
    panel = quad(corners[0], corners[1], corners[2], (0.0, 0.0, 0.0))
    camera = replace(ABOVE, position=(0.0, 0.6, 0.0), fov=80.0)
    scene = build(plane(1.2, albedo=tuple(ALBEDO)), panel, camera=camera)
    if pixels is not None:
        uvs = np.concatenate([np.zeros((4, 2)), [(c[0] / 0.8 + 0.375, 0.5) for c in corners]])
        scene = textured(scene, pixels, uvs)
    texture = None if pixels is None else TextureRef(0)
    shining = replace(scene.materials[1], base_color_texture=None, emission=RGB)
    shining = replace(shining, emission_texture=texture, emits_both_sides=both)
    return replace(scene, materials=(scene.materials[0], shining), lights=()), np.array(corners)


@pytest.mark.parametrize(("down", "both"), [(True, False), (True, True), (False, True)])
def test_an_emitting_panel_is_lamberts_polygon(down, both):
    floor, corners = make_panel(down=down, both=both)
    points, *found = light_floor(floor=floor, spp=256)
    assert_is(compute_polygon_irradiance(corners, points), *found)


def test_the_back_of_a_panel_is_dark():
    floor, _ = make_panel(down=False)
    assert not light_floor(floor=floor, spp=16)[1].any()


def test_a_texture_of_emission_is_looked_up():
    pixels = np.zeros((1, 512, 3), np.uint8)
    pixels[:, 256:] = 255
    floor, corners = make_panel(pixels=pixels)
    points, *found = light_floor(floor=floor, spp=256)
    right = np.where(corners[:, :1] < 0, np.array([0.1, 0.7, 0.0]), corners)
    right[:, 2] = corners[:, 2]
    assert_is(compute_polygon_irradiance(right, points), *found, bias=1e-3)


def test_the_camera_sees_the_side_of_a_surface_that_shines():
    floor, _ = make_panel(down=False)
    for both, height, expected in ((False, 3.0, RGB), (False, 0.1, (0, 0, 0)), (True, 0.1, RGB)):
        shining = replace(floor.materials[1], emits_both_sides=both)
        camera = Camera((0.1, height, 0.0), (0.1, 0.7, 0.0), (0.0, 0.0, -1.0), fov=1.0)
        scene = replace(floor, camera=camera, materials=(floor.materials[0], shining))
        for kind in ({"spp": 2}, {"vpls": 2}):
            made = trace_reference(scene, (2, 2), **kind)
            np.testing.assert_allclose(made.emission, np.broadcast_to(expected, (2, 2, 3)))
            np.testing.assert_allclose(made.radiance, made.emission + made.direct + made.indirect)


@pytest.mark.parametrize("bounces", [0, 2])
def test_a_furnace_of_emitting_walls_is_the_geometric_series(bounces):
    rho = 0.6
    scene = build(box((-1, -1, -1), (1, 1, 1), (rho,) * 3), camera=Camera((0.1, 0.2, 0.3), (0.5, 0.4, -1.0)))
    walls = replace(scene.materials[0], emission=RGB, emits_both_sides=True)
    made = trace_reference(replace(scene, materials=(walls,), lights=()), SIZE, spp=64, bounces=bounces)
    np.testing.assert_allclose(made.emission, np.broadcast_to(RGB, made.emission.shape))
    for light, factor in ((made.direct, rho), (made.indirect, sum(rho**k for k in range(2, bounces + 2)))):
        assert light.mean() == pytest.approx(np.mean(RGB) * factor, rel=5e-3)


def test_a_white_ball_in_a_white_world_vanishes():
    ball = sphere(1.0, 2, (1.0, 1.0, 1.0))
    scene = build(replace(ball, normals=None), camera=Camera((0, 0, 4), (0, 0, 0), fov=40.0))
    for white in (Environment(radiance=(1.0, 1.0, 1.0)), Environment(image=np.ones((4, 8, 3)), rotation=30.0)):
        made = trace_reference(replace(scene, lights=(white,)), (24, 24), spp=64)
        np.testing.assert_allclose(made.radiance[~made.hit], 1)
        assert made.radiance[made.hit].mean() == pytest.approx(1, abs=4e-3)
        assert not made.indirect.any()


def make_mixture():
    """Return a box in a room without a ceiling, and all that can be met: a sky, a panel and flat lights."""
    walls = box((-1, -1, -1), (1, 1, 1), (0.7, 0.6, 0.5))
    walls = replace(walls, faces=[face for face in walls.faces if not (walls.positions[face][:, 1] == 1).all()])
    panel = quad((-0.9, -0.5, -0.99), (-0.4, -0.5, -0.99), (-0.4, 0.3, -0.99))
    scene = build(walls, box((-0.2, -1, -0.5), (0.3, -0.3, 0.0)), panel, camera=room().camera)
    pixels = np.random.default_rng(3).random((8, 16, 3)) ** 8
    lights = (
        Environment(image=pixels, rotation=40.0),
        Rect((0.8, 0.3, 0.2), (0.0, -0.5, 0.0), (0.5, 0.3), radiance=RGB),
        Disc((-0.3, 0.9, 0.5), (0.0, -1.0, 0.2), 0.3, RGB),
    )
    return replace(scene, lights=lights, materials=(*scene.materials[:2], replace(scene.materials[2], emission=RGB)))


@pytest.mark.slow
def test_both_ways_of_sampling_agree_alone_and_together(monkeypatch):
    scene = make_mixture()
    made = {}
    for name, light, bounce in (("both", None, None), ("emitters", 1.0, 0.0), ("bounces", 0.0, 1.0)):
        with monkeypatch.context() as patch:
            if name != "both":
                patch.setattr("deferred_ir.truth.lighting.weigh_light", lambda density, _, w=light: w + 0 * density)
                patch.setattr("deferred_ir.truth.lighting.weigh_bounce", lambda _, density, w=bounce: w + 0 * density)
            made[name] = PathTracer(scene, Tracer(scene), bounces=2).estimate((16, 16), 256, seed=5)
    for part in ("direct", "indirect"):
        means = {name: getattr(one, part).mean() for name, one in made.items()}
        assert means["emitters"] == pytest.approx(means["both"], rel=0.02)
        assert means["bounces"] == pytest.approx(means["both"], rel=0.02)
    both = made.pop("both")
    for one in made.values():
        off = (one.direct + one.indirect - both.direct - both.indirect) / np.sqrt(one.variance + both.variance)
        assert (np.abs(off[both.hit]) < 3).mean() > 0.98
        sigma = np.sqrt((one.variance + both.variance)[..., 1].sum())
        total = (one.direct + one.indirect - both.direct - both.indirect)[..., 1].sum()
        assert abs(total) < 3 * sigma
        assert both.variance.mean() < one.variance.mean()


def test_one_of_many_lights_is_chosen_without_bias():
    rng = np.random.default_rng(1)
    lights = [
        Point(tuple(place), tuple(np.array(RGB) * strength))
        for place, strength in zip(rng.uniform((-1, 0.6, -1), (1, 1.4, 1), (30, 3)), rng.random(30) ** 4, strict=True)
    ]
    lights += [Directional((1.0, 2.0, 0.0), (0.0, 0.0, 0.0), RGB), Sphere((0.4, 0.8, 0.0), 0.2, RGB)]
    expected = sum(light_floor(light, spp=1024)[1] for light in lights)
    _, *found = light_floor(*lights, spp=256)
    assert_is(expected[..., 0], *found, bias=1e-3)
    assert 0 < found[1].mean() < 0.1 * found[0].mean()


def test_a_mixture_is_the_same_for_any_number_of_threads(monkeypatch):
    monkeypatch.setattr("deferred_ir.truth.path_tracer.RAYS", 512)
    monkeypatch.setattr("deferred_ir.truth.lighting.MOST_EACH", 1)
    images = [trace_reference(make_mixture(), (16, 16), spp=8, bounces=2, threads=n).radiance for n in (1, 2, 5)]
    np.testing.assert_array_equal(images[0], images[1])
    np.testing.assert_array_equal(images[0], images[2])


def test_lights_that_are_off_cost_nothing_and_leave_the_rest_as_it_is():
    scene = room()
    dark = (Point((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)), Environment(radiance=(0.0, 0.0, 0.0)))
    one, other = (
        trace_reference(replace(scene, lights=(*lights, *scene.lights)), (8, 8), spp=8) for lights in ((), dark)
    )
    np.testing.assert_array_equal(one.radiance, other.radiance)
    assert not trace_reference(replace(scene, lights=()), (8, 8), spp=8).radiance.any()


def test_twins_read_only_fields_of_lights():
    known = {field.name for kind in find_kinds().values() for field in fields(kind)}
    read = set()
    for name in find_kinds():
        for node in ast.walk(ast.parse(MODULES[f"deferred_ir.truth.emitters.{name}"].read_text())):
            if isinstance(node, ast.Attribute):
                of = node.value
                if (isinstance(of, ast.Name) and of.id == "light") or (
                    isinstance(of, ast.Attribute) and of.attr == "light"
                ):
                    read.add(node.attr)
    assert read <= known
    assert len(read) > 5
