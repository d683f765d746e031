"""The mask of pixels without an edge inside, on scenes of which every edge is known."""

from dataclasses import replace
from importlib import import_module

import numpy as np
import pytest
from small_scenes import box, build, plane, quad, sphere, textured

from deferred_ir.scene.camera import Camera
from deferred_ir.scene.lights.directional import Directional
from deferred_ir.scene.lights.environment import Environment
from deferred_ir.scene.lights.point import Point
from deferred_ir.scene.lights.rect import Rect
from deferred_ir.scene.lights.spotlight import Spotlight
from deferred_ir.truth.metrics import masked_relmse, relmse

edge_mask = import_module("deferred_ir.profiling.sweep.edge_mask")

SIZE = (40, 30)
FINE = 16
DOWN = Camera((0.0, 2.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, -1.0), 50.0)
"""Sees x and z of the plane y = 0 to the right and down."""
ABOVE = Spotlight((0.0, 4.0, 0.0), (0.0, 0.0, 0.0), 100.0)
"""Lights all that DOWN sees."""


def kept(scene, size=SIZE):
    return edge_mask.find(scene, size).counts


def on_floor(camera, size):
    """Points of the plane y = 0 through the middles of FINE x FINE parts of each pixel, (H FINE, W FINE, 3)."""
    way = camera.rays((size[0] * FINE, size[1] * FINE))
    start = np.asarray(camera.position)
    return start + way * (-start[1] / way[..., 1:2])


def mixed(flags, margin=0):
    """Pixels in which flags (H FINE, W FINE) are neither all set nor all clear; with parts of the neighbours around."""
    parts = np.pad(flags, max(margin, 0), mode="edge")
    parts = np.lib.stride_tricks.sliding_window_view(parts, (FINE + 2 * margin,) * 2)[::FINE, ::FINE]
    return parts.any(axis=(-1, -2)) & ~parts.all(axis=(-1, -2))


def assert_borders(kept, flags):
    """The mask leaves out what a border of `flags` crosses, but for corners smaller than the lattice's step."""
    assert mixed(flags).sum() > 20
    assert not (~kept & ~mixed(flags, 1)).any()
    assert (kept & mixed(flags)).sum() <= 0.1 * mixed(flags).sum()


def test_a_lit_plane_has_no_edges_and_the_background_does_not_count():
    assert kept(build(plane(9), camera=DOWN, spotlight=ABOVE)).all()
    small = kept(build(plane(0.6), camera=DOWN, spotlight=ABOVE))
    inside = np.abs(on_floor(DOWN, SIZE)).max(axis=-1) < 0.6
    np.testing.assert_array_equal(small, inside[::FINE, ::FINE] & inside[FINE - 1 :: FINE, FINE - 1 :: FINE])


def test_a_step_of_albedo_is_an_edge_and_a_slight_one_is_not():
    x = 0.01  # not on the border of two pixels
    for other, expected in (((0.7, 0.5, 0.5), True), ((0.51, 0.5, 0.5), False)):
        halves = quad((-9, 0, 9), (x, 0, 9), (x, 0, -9)), quad((x, 0, 9), (9, 0, 9), (9, 0, -9), other)
        scene = build(*halves, camera=DOWN, spotlight=ABOVE)
        # One material, with colours at its corners.
        colors = np.repeat([[0.5] * 3, other], 4, axis=0).astype("f4")
        geometry = replace(scene.geometry, colors=colors, face_materials=np.zeros(4, "i4"))
        scene = replace(scene, geometry=geometry, materials=(replace(scene.materials[0], base_color=(1.0, 1.0, 1.0)),))
        points = on_floor(DOWN, SIZE)
        crossed = mixed(points[..., 0] > x)
        assert crossed.sum() == SIZE[1]
        np.testing.assert_array_equal(kept(scene), ~(crossed & expected))


def test_texels_with_a_step_between_them_are_edges():
    pixels = np.zeros((2, 512, 3), np.uint8)
    pixels[:, 256:] = 200
    scene = textured(build(plane(2), camera=DOWN, spotlight=ABOVE), pixels, [(0, 0), (1, 0), (1, 1), (0, 1)])
    left_out = ~kept(scene)
    assert left_out[:, 19:21].all()  # u = 1/2 is the border of two pixels
    assert left_out.sum() == 2 * SIZE[1]


def test_corners_of_a_room_are_edges_even_of_one_albedo():
    scene = build(box((-1, -1, -1), (1, 1, 1)), camera=Camera((0, 0, 0.9), (0, 0, 0), fov=90), spotlight=ABOVE)
    mask = kept(scene, (32, 32))
    left_out = ~mask
    assert left_out[:, 16].any()
    assert left_out.sum() < 0.3 * left_out.size
    assert mask[16, 16]
    diagonal = np.diag(left_out)  # where side walls meet floor and ceiling
    assert diagonal[:7].all()
    assert diagonal[-7:].all()


def test_the_border_of_the_cone_is_an_edge():
    light = Spotlight((0.3, 1.5, 0.2), (0.1, 0.0, 0.0), 40.0)
    points = on_floor(DOWN, SIZE)
    way = points - np.asarray(light.position)
    inside = light.cone(way / np.linalg.norm(way, axis=-1, keepdims=True)) > 0
    assert_borders(kept(build(plane(9), camera=DOWN, spotlight=light)), inside)


def test_the_border_of_a_shadow_is_an_edge():
    # Above the camera, out of its sight: casts a square shadow, twice its size.
    light = Spotlight((0.1, 6.0, 0.05), (0.1, 0.0, 0.05), 100.0)
    card = quad((-0.2, 3, 0.15), (0.15, 3, 0.15), (0.15, 3, -0.2))
    points = on_floor(DOWN, SIZE)
    middle = (points + np.asarray(light.position)) / 2
    shadow = ((middle[..., ::2] > -0.2) & (middle[..., ::2] < 0.15)).all(axis=-1)
    assert_borders(kept(build(plane(9), card, camera=DOWN, spotlight=light)), shadow)


def test_the_shadow_of_each_light_has_a_border_and_that_of_an_area_has_none():
    card = quad((-0.2, 3, 0.15), (0.15, 3, 0.15), (0.15, 3, -0.2))
    scene = build(plane(9), card, camera=DOWN)
    lights = Point((0.4, 6.0, 0.1)), Directional((-0.1, 1.0, 0.1), (0.0, 0.0, 0.0)), ABOVE
    alone = [kept(replace(scene, lights=(light,))) for light in lights]
    assert all(0 < (~mask).sum() < 0.2 * mask.size for mask in alone)
    np.testing.assert_array_equal(kept(replace(scene, lights=lights)), np.all(alone, axis=0))
    soft = Rect((0.4, 6.0, 0.1), (0.0, 0.0, 0.0), (1.0, 1.0)), Environment(radiance=(1.0, 1.0, 1.0))
    assert kept(replace(scene, lights=soft)).all()


def test_facets_of_a_smooth_surface_are_no_edges_but_its_outline_is():
    camera = Camera((0, 0, 5), (0, 0, 0), fov=30)
    light = Spotlight((0, 0, 5), (0, 0, 0), 100.0)
    scene = build(sphere(1, 5), plane(9, -1.5), camera=camera, spotlight=light)
    mask = kept(scene, (64, 64))
    y, x = np.mgrid[:64, :64]
    radius = np.hypot(x - 31.5, y - 31.5)
    seen = 32 * np.tan(np.arcsin(1 / 5)) / np.tan(np.radians(15))
    assert mask[radius < 0.5 * seen].all()
    assert not mask[np.abs(radius - seen) < 0.4].any()


def test_rows_at_once_do_not_show(monkeypatch):
    scene = build(plane(0.6), box((-0.2, 0, -0.2), (0.2, 0.3, 0.2)), camera=DOWN, spotlight=ABOVE)
    whole = edge_mask.find(scene, SIZE)
    monkeypatch.setattr(edge_mask, "ROWS", 7)
    assert edge_mask.find(scene, SIZE).hash == whole.hash


@pytest.fixture
def folder(tmp_path):
    rng = np.random.default_rng(1)
    edge_mask.save(tmp_path, edge_mask.Mask(rng.random((30, 40)) < 0.8), "a" * 16)
    return tmp_path


def test_a_mask_comes_back_from_its_files(folder):
    mask = edge_mask.read(folder, "a" * 16, SIZE)
    assert mask.counts.shape == (30, 40)
    assert mask.left_out == pytest.approx(0.2, abs=0.05)
    assert {path.name for path in folder.iterdir()} == {"mask.npy", "mask.json", "mask.png"}
    assert edge_mask.read(folder, "b" * 16, SIZE) is None
    assert edge_mask.read(folder, "a" * 16, (30, 40)) is None


@pytest.mark.parametrize("name", ["mask.npy", "mask.json", "mask.png"])
@pytest.mark.parametrize("part", [0.0, 0.5, None])
def test_an_incomplete_mask_is_found_again(folder, name, part):
    data = (folder / name).read_bytes()
    if part is None:
        (folder / name).unlink()
    elif name != "mask.png":
        (folder / name).write_bytes(data[: int(part * len(data))])
    whole = part is not None and name == "mask.png"  # for people, and not read
    assert (edge_mask.read(folder, "a" * 16, SIZE) is None) == (not whole)


def test_masked_relmse_is_that_of_an_image_of_these_pixels_alone():
    rng = np.random.default_rng(2)
    image, truth = rng.random((2, 20, 30, 3)) + 0.1
    truth[:, 12:] *= 50
    mask = np.zeros((20, 30), np.bool_)
    mask[3:18, 2:12] = True
    expected = relmse(image[3:18, 2:12], truth[3:18, 2:12], np.ones((15, 10), np.bool_))[0]
    assert masked_relmse(image, truth, mask) == pytest.approx(expected, rel=1e-12)
    assert masked_relmse(image, truth, np.zeros_like(mask)) is None
    truth[mask] = 0
    assert masked_relmse(image, truth, mask) is None
