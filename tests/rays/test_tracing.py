"""Rays in scenes about which everything is known."""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np
import pytest
from small_scenes import Mesh, box, build, plane, room, sphere, textured

from deferred_ir.base.colour import linear_from_srgb
from deferred_ir.base.errors import DeviceError
from deferred_ir.rays.tracer import CHUNK, Tracer, face_towards

RNG = np.random.default_rng(7)


def directions(count: int) -> np.ndarray:
    vectors = RNG.normal(size=(count, 3))
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def test_rays_meet_a_plane_where_they_should():
    tracer = Tracer(build(plane(10.0, height=0.5, albedo=(0.2, 0.4, 0.6))))
    origins = RNG.uniform((-1, 1, -1), (1, 3, 1), (500, 3))
    targets = np.column_stack([RNG.uniform(-3, 3, 500), np.full(500, 0.5), RNG.uniform(-3, 3, 500)])
    hits = tracer.closest(origins, 3 * (targets - origins))  # of any length
    assert hits.hit.all()
    np.testing.assert_allclose(hits.position, targets, atol=2e-6)
    np.testing.assert_allclose(hits.normal, np.tile((0.0, 1, 0), (500, 1)), atol=1e-12)
    np.testing.assert_array_equal(hits.shading_normal, hits.normal)
    np.testing.assert_allclose(hits.albedo, np.tile((0.2, 0.4, 0.6), (500, 1)))


def test_the_normal_is_turned_against_the_ray():
    tracer = Tracer(build(plane()))
    origins = np.array([[0.1, 1.0, 0.2], [0.1, -1.0, 0.2]])
    hits = tracer.closest(origins, -origins)
    np.testing.assert_allclose(hits.normal, [[0, 1, 0], [0, -1, 0]], atol=1e-12)


def test_rays_that_miss_hold_zeros():
    hits = Tracer(build(plane())).closest(np.array([[0, 1.0, 0], [0, 1, 0]]), np.array([[0, 1.0, 0], [0, -1, 0]]))
    np.testing.assert_array_equal(hits.hit, [False, True])
    assert hits.face[0] == -1
    for array in (hits.position, hits.normal, hits.shading_normal, hits.albedo):
        np.testing.assert_array_equal(array[0], 0)


def test_no_rays_at_all():
    tracer, none = Tracer(build(plane())), np.zeros((0, 3))
    hits = tracer.closest(none, none)
    assert (hits.position.shape, hits.face.shape, tracer.occluded(none, none).shape) == ((0, 3), (0,), (0,))
    rows, near = tracer.within(none, none, 1.0)
    assert (rows.shape, near.position.shape) == ((0,), (0, 3))


def test_from_inside_a_box_every_ray_meets_the_wall_it_points_at():
    low, high = np.array([-1.0, -2, -3]), np.array([3.0, 2, 1])
    tracer = Tracer(build(box(low, high)))
    ways = directions(2000)
    hits = tracer.closest(np.full((2000, 3), 0.25), ways)
    assert hits.hit.all()
    distance = np.where(ways > 0, (high - 0.25) / ways, (low - 0.25) / ways)
    axis = distance.argmin(axis=1)
    rows = np.arange(2000)
    np.testing.assert_allclose(hits.position, 0.25 + ways * distance[rows, axis][:, None], atol=1e-5)
    normals = np.zeros((2000, 3))
    normals[rows, axis] = -np.sign(ways[rows, axis])
    np.testing.assert_allclose(hits.normal, normals, atol=1e-6)


def test_more_rays_than_a_chunk_are_the_same_as_each():
    tracer = Tracer(room())
    ways = directions(2 * CHUNK + 3)
    origins = np.zeros_like(ways)
    whole = tracer.closest(origins, ways)
    parts = np.concatenate([tracer.closest(origins[i::5], ways[i::5]).position for i in range(5)])
    np.testing.assert_array_equal(np.concatenate([whole.position[i::5] for i in range(5)]), parts)


def test_smooth_normals_are_blended_and_unit():
    tracer = Tracer(build(sphere(2.0)))
    ways = directions(1000)
    hits = tracer.closest(np.zeros((1000, 3)), ways)
    assert hits.hit.all()
    np.testing.assert_allclose(np.linalg.norm(hits.shading_normal, axis=1), 1)
    np.testing.assert_allclose(hits.shading_normal, -ways, atol=0.01)  # from inside: turned to the centre
    assert np.abs(hits.normal - hits.shading_normal).max() > 0.01  # the faces' own are coarser


def test_the_shading_normal_is_turned_into_the_hemisphere_of_the_face():
    quad = plane()
    slanted = np.tile(np.array([0.6, -0.8, 0.0]), (4, 1))  # the file's normals point below the face
    hits = Tracer(build(replace(quad, normals=slanted))).closest(
        np.array([[0.1, 1.0, 0.2], [0.1, -1, 0.2]]), np.array([[0, -1.0, 0], [0, 1, 0]])
    )
    np.testing.assert_allclose(hits.normal, [[0, 1, 0], [0, -1, 0]], atol=1e-12)
    np.testing.assert_allclose(hits.shading_normal, [[-0.6, 0.8, 0], [0.6, -0.8, 0]], atol=1e-6)


def test_a_zero_normal_means_the_face_has_its_own():
    smooth = sphere(0.5)
    tracer = Tracer(build(plane(), Mesh(smooth.positions + np.array([0, 3, 0]), smooth.faces, normals=smooth.normals)))
    hits = tracer.closest(np.array([[0.3, 1.0, 0.3]]), np.array([[0.0, -1, 0]]))
    np.testing.assert_allclose(hits.shading_normal, [[0, 1, 0]], atol=1e-12)


def test_the_albedo_is_material_times_texture_where_the_ray_lands():
    pixels = np.array([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [188, 188, 188]]])  # top row first
    scene = textured(build(plane(albedo=(0.5, 1.0, 1.0))), pixels, [[0, 0], [1, 0], [1, 1], [0, 1]])
    texels = [(-0.5, -0.5), (0.5, -0.5), (-0.5, 0.5), (0.5, 0.5)]  # v = 1, the top edge, lies at z = -1
    origins = np.array([(x, 1.0, z) for x, z in texels])
    hits = Tracer(scene).closest(origins, np.tile((0.0, -1, 0), (4, 1)))
    grey = float(linear_from_srgb(188 / 255))
    expected = [[0.5, 0, 0], [0, 1, 0], [0, 0, 1], [0.5 * grey, grey, grey]]
    np.testing.assert_allclose(hits.albedo, expected, atol=1e-5)


# Occlusion


def test_a_point_is_occluded_by_what_lies_between():
    tracer = Tracer(build(plane()))
    above, below, aside = (0.0, 1.0, 0.0), (0.2, -1.0, 0.1), (3.0, -1.0, 0.0)
    blocked = tracer.occluded(np.array([above, above, above, below]), np.array([below, aside, (0, 0.1, 0), above]))
    np.testing.assert_array_equal(blocked, [True, False, False, True])


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_surfaces_at_either_end_do_not_occlude(scale):
    """From lifted points of a box's walls to others: nothing is between, whatever the distance and the angle."""
    scene = build(box((-scale, -scale, -scale), (scale, scale, scale)))
    tracer = Tracer(scene)
    hits = tracer.closest(np.zeros((2000, 3)), directions(2000))
    lifted = tracer.lift(hits.position, hits.normal)
    from_, to = lifted[:1000], hits.position[1000:]
    facing = ((to - from_) * hits.normal[:1000]).sum(axis=1) > 1e-3 * scale
    assert facing.sum() > 500
    assert not tracer.occluded(from_[facing], to[facing]).any()


def test_a_thin_wall_close_to_the_target_still_occludes():
    tracer = Tracer(build(plane()))
    above = np.array([[0.0, 1.0, 0.0]])
    assert tracer.occluded(above, np.array([[0.0, -0.001, 0.0]])).all()
    assert not tracer.occluded(above, np.array([[0.0, -0.00005, 0.0]])).any()  # a ten-thousandth of the way


def test_an_origin_on_a_surface_needs_its_lift():
    tracer = Tracer(build(plane()))
    on_plane, above = np.array([[0.1, 0.0, 0.2]]), np.array([[0.3, 1.0, 0.1]])
    assert tracer.occluded(on_plane, above).all()
    assert not tracer.occluded(tracer.lift(on_plane, np.array([[0.0, 1, 0]])), above).any()
    assert not tracer.occluded(above, on_plane).any()


def test_occlusion_is_symmetric():
    tracer = Tracer(room())
    a, b = RNG.uniform(-0.9, 0.9, (2, 3000, 3))
    np.testing.assert_array_equal(tracer.occluded(a, b), tracer.occluded(b, a))


def test_lifted_points_lie_off_the_surface_by_little():
    scene = room()
    tracer = Tracer(scene)
    lifted = tracer.lift(np.zeros((1, 3)), np.array([[0.0, 0, 1]]))
    assert 1e-6 * scene.geometry.diagonal < lifted[0, 2] < 1e-4 * scene.geometry.diagonal


def test_time_spent_in_embree_is_counted():
    tracer = Tracer(room())
    before = tracer.seconds
    tracer.closest(np.zeros((1000, 3)), directions(1000))
    assert tracer.seconds > before


def test_without_embreex_one_line_says_what_still_works(monkeypatch):
    monkeypatch.setitem(sys.modules, "embreex", None)
    with pytest.raises(DeviceError, match=r"^embreex: .*--vpls 0$"):
        Tracer(room())


def test_turned():
    towards = np.array([[0.0, 0, 1], [0, 0, 1]])
    np.testing.assert_array_equal(face_towards(np.array([[0.0, 1, -1], [1, 0, 1]]), towards), [[0, -1, 1], [1, 0, 1]])
