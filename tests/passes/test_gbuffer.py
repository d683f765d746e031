"""The G-buffer against ray casting: what each pixel shows, where, and which way it faces."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from small_scenes import GREY, Mesh, box, build, plane, quad, room, sphere, textured

from deferred_ir.base.colour import srgb_table
from deferred_ir.frame.frame import FRAME, NEAR, Frame
from deferred_ir.loading.load import load
from deferred_ir.rays.tracer import Tracer
from deferred_ir.scene.camera import Camera
from deferred_ir.scene.scene import Scene

SIZE = (112, 80)


def checkers() -> Scene:
    """A tilted view of a plane with a texture that repeats twice, below a smooth sphere."""
    pixels = np.random.default_rng(0).integers(30, 255, (8, 16, 3))
    ball = sphere(0.4, 3, (0.1234, 0.03, 0.9))
    ball = replace(ball, positions=ball.positions + np.array([0, 0.5, 0]))
    uvs = np.zeros((len(ball.positions) + 4, 2))
    uvs[-4:] = [[-0.5, 0], [1.5, 0], [1.5, 2], [-0.5, 2]]
    camera = Camera((0.13, 2.0, 3.0), (0.02, 0.1, 0.0))  # no pixel's centre exactly on an edge
    return textured(build(ball, plane(1.0, albedo=(1.0, 0.8, 0.6)), camera=camera), pixels, uvs)


SCENES = {"room": room, "checkers": checkers, "colors": lambda: load("colors"), "cornell": lambda: load("cornell")}


@pytest.fixture(params=SCENES)
def scene(request) -> Scene:
    return SCENES[request.param]()


@pytest.fixture
def drawn(renderer, scene):
    """depth, normals and albedo of the scene, top row first, and the hits of the same pixels' rays."""
    return gbuffer(renderer, scene), first_hits(scene)


def gbuffer(renderer, scene, graph="deferred", **options):
    one = renderer(SIZE, graph, **options)
    one.render(scene, vpls=0)
    with one.gpu.ctx:
        return {port: one.executor.resource(("gbuffer", port)).read()[::-1] for port in ("depth", "normals", "albedo")}


def first_hits(scene):
    rays = scene.camera.rays(SIZE).reshape(-1, 3)
    return Tracer(scene).closest(np.broadcast_to(scene.camera.position, rays.shape), rays)


def unproject(scene, depth):
    """World positions (H, W, 3) by the formula of lib/camera/frame.glsl, from the block that shaders get."""
    block = np.frombuffer(Frame(SIZE, scene, None, None).pack(), FRAME)[0]
    height, width = depth.shape[:2]
    x = (np.arange(width) + 0.5) / width * 2 - 1
    y = 1 - (np.arange(height) + 0.5) / height * 2
    a, b, c = block["ray"][:, :3].astype(float)
    way = x[None, :, None] * a + y[:, None, None] * b + c
    return block["camera"] + way * (block["near"] / depth.astype(float))


def decoded(code):
    """Unit vectors of octahedral codes (..., 2)."""
    p = code * 2.0 - 1.0
    z = 1 - np.abs(p).sum(axis=-1, keepdims=True)
    fold = np.maximum(-z, 0)
    n = np.concatenate([p - np.where(p < 0, -fold, fold), z], axis=-1)
    return n / np.linalg.norm(n, axis=-1, keepdims=True)


def agree(found, expected, tolerance):
    """Whether rows agree, where one pixel in a thousand may show the other side of a silhouette."""
    off = np.abs(found - expected).max(axis=-1) > tolerance
    return off.mean() < 1e-3


def test_the_background_is_where_rays_miss(drawn):
    buffers, hits = drawn
    assert ((buffers["depth"].ravel() > 0) != hits.hit).mean() < 1e-3
    assert (buffers["albedo"][buffers["depth"][..., 0] == 0] == 0).all()
    np.testing.assert_array_equal(buffers["albedo"][..., 3] == 1, buffers["depth"][..., 0] > 0)


def test_positions_are_where_rays_hit(drawn, scene):
    buffers, hits = drawn
    both = hits.hit & (buffers["depth"].ravel() > 0)
    assert both.sum() > 1000
    found = unproject(scene, np.where(buffers["depth"] > 0, buffers["depth"], 1)).reshape(-1, 3)
    assert agree(found[both], hits.position[both], 1e-5 * scene.geometry.diagonal)


def test_normals_are_those_of_the_hits(drawn):
    buffers, hits = drawn
    both = hits.hit & (buffers["depth"].ravel() > 0)
    normals = buffers["normals"].reshape(-1, 4)[both]
    assert agree(decoded(normals[:, :2]), hits.shading_normal[both], 1e-3)
    assert agree(decoded(normals[:, 2:]), hits.normal[both], 1e-3)


def test_albedo_is_that_of_the_hits(drawn):
    """To half precision, which drivers may round or cut; a texture's texels are halves themselves."""
    buffers, hits = drawn
    both = hits.hit & (buffers["depth"].ravel() > 0)
    found = buffers["albedo"].reshape(-1, 4)[both, :3]
    assert agree(found / hits.albedo[both], np.ones_like(found), 2.0**-10 + 2.0**-11)


def test_texels_are_decoded_exactly_all_256_levels(renderer):
    """A row of 256 pixels, one for each texel."""
    pixels = np.repeat(np.arange(256)[None, :, None], 3, axis=2)
    wall = quad((-1, -1, 0), (1, -1, 0), (1, 1, 0))
    scene = textured(build(wall, camera=Camera((0, 0, 1), (0, 0, 0), fov=90)), pixels, [[0, 0], [1, 0], [1, 1], [0, 1]])
    one = renderer((256, 256), "deferred")
    one.render(scene, vpls=0)
    with one.gpu.ctx:
        found = one.executor.resource(("gbuffer", "albedo")).read()[:, :, 0]
    expected = 0.5 * srgb_table()
    np.testing.assert_allclose(found, np.broadcast_to(expected, found.shape), rtol=2.0**-10 + 2.0**-11)


def test_depth_is_near_over_distance(renderer):
    """Straight at a wall: the same distance in every pixel."""
    scene = build(box((-9, -9, -4), (9, 9, -3)), camera=Camera((0, 0, 2), (0, 0, 0)))
    depth = gbuffer(renderer, scene)["depth"]
    np.testing.assert_allclose(depth, NEAR * scene.geometry.diagonal / 5, rtol=1e-6)


def test_what_lies_behind_the_camera_or_before_the_near_plane_does_not_show(renderer):
    camera = Camera((0, 3, 0), (0, 0, 0.1))
    scene = build(plane(1.0, height=0.0), plane(1.0, height=4.0), camera=camera)
    depth = gbuffer(renderer, scene)["depth"]
    distance = NEAR * scene.geometry.diagonal / depth[depth > 0]
    assert 2.9 < distance.min() <= distance.max() < 3.3


def test_both_sides_of_a_face_show_and_are_turned_to_the_viewer(renderer):
    for height in (2.0, -2.0):
        scene = build(plane(), camera=Camera((0, height, 0.5), (0, 0, 0)))
        buffers = gbuffer(renderer, scene)
        shown = buffers["depth"][..., 0] > 0
        assert shown.mean() > 0.2
        normals = decoded(buffers["normals"][shown][:, 2:])
        np.testing.assert_allclose(normals, np.broadcast_to((0, np.sign(height), 0), normals.shape), atol=1e-4)


def test_a_shading_normal_is_turned_into_the_hemisphere_of_its_face(renderer):
    """From a file whose normals point below the face, and seen from either side."""
    slanted = replace(plane(), normals=np.tile((0.6, -0.8, 0.0), (4, 1)))
    for height in (2.0, -2.0):
        scene = build(slanted, camera=Camera((0, height, 0.5), (0, 0, 0)))
        buffers = gbuffer(renderer, scene)
        normals = decoded(buffers["normals"][buffers["depth"][..., 0] > 0][:, :2])
        expected = np.multiply(np.sign(height), (-0.6, 0.8, 0))
        np.testing.assert_allclose(normals, np.broadcast_to(expected, normals.shape), atol=1e-4)


def test_the_nearest_of_two_surfaces_shows_whatever_their_order(renderer):
    near, far = plane(0.5, height=0.5, albedo=(1, 0, 0)), plane(1.0, albedo=(0, 1, 0))
    one, other = (gbuffer(renderer, build(*meshes)) for meshes in ((near, far), (far, near)))
    np.testing.assert_array_equal(one["albedo"], other["albedo"])
    assert {tuple(color) for color in one["albedo"].reshape(-1, 4)[:, :3].round(3)} == {(1, 0, 0), (0, 1, 0), (0, 0, 0)}


def test_a_very_thin_gap_between_surfaces_is_resolved(renderer):
    """A ten-thousandth of the distance apart, seen at a slant: 24 bits of depth would mix them."""
    scene = build(plane(1.0, height=3e-4, albedo=(1, 0, 0)), plane(1.0, albedo=(0, 1, 0)))
    albedo = gbuffer(renderer, scene)["albedo"]
    hits = first_hits(scene)
    green = (albedo[..., 1] > 0).ravel()
    assert (green != (hits.albedo[:, 1] > 0)).mean() < 1e-3


def test_degenerate_faces_and_zero_normals_leave_no_trace(renderer):
    flat = Mesh(np.zeros((3, 3)), np.array([[0, 1, 2]]), GREY)
    scene, clean = build(flat, plane()), build(plane())
    np.testing.assert_array_equal(gbuffer(renderer, scene)["albedo"], gbuffer(renderer, clean)["albedo"])
