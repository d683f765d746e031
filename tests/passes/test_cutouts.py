"""What is cut out of a surface lets the camera, light and rays through, in every graph alike."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from equivalence import assert_equivalent
from surface_scenes import lattice

from deferred_ir.engine.renderer import Renderer
from deferred_ir.rays.direct import irradiate
from deferred_ir.rays.tracer import Tracer
from deferred_ir.scene.motion import ModelMotion
from deferred_ir.scene.scene import Geometry, Model
from deferred_ir.truth.path_tracer import PathTracer

SIZE = (96, 96)


def light_by_rays(scene):
    tracer = Tracer(scene)
    seen = PathTracer(scene, tracer).trace_camera_rays(SIZE)
    light = irradiate(scene.spotlight, tracer, seen, None) * np.asarray(scene.spotlight.emission)
    return (seen.albedo * light / np.pi).reshape(*SIZE[::-1], 3)


def trace(scene):
    estimate = PathTracer(scene, Tracer(scene), bounces=1).estimate(SIZE, 64, seed=1)
    return estimate.direct + estimate.indirect


@pytest.mark.parametrize("wrap", ["repeat", "mirror", "clamp"])
def test_camera_and_spotlight_see_the_holes_that_rays_see(renderer, wrap):
    scene = lattice(wrap)
    expected = light_by_rays(scene)
    found = renderer(SIZE, "deferred").render(scene, vpls=0).radiance
    whole = light_by_rays(lattice(wrap, cutoff=None))
    off = np.abs(found - expected).max(axis=2) > 0.02 * expected.max()
    assert off.mean() < 0.03  # borders of shadows, a texel wide
    assert (np.abs(whole - expected).max(axis=2) > 0.02 * expected.max()).mean() > 0.1


@pytest.mark.parametrize("projection", ["perspective", "paraboloid"])
def test_forward_and_deferred_cut_alike(projection):
    scene = lattice()
    images = []
    for graph in ("forward", "deferred"):
        with Renderer(device="software", size=SIZE, graph=graph, set={"shadow_maps.projection": projection}) as one:
            images.append(one.render(scene, vpls=16).radiance)
    assert_equivalent(*reversed(images), np.ones(SIZE, bool))


def test_vpls_shine_through_holes_in_maps_of_every_kind(renderer):
    """Paraboloid maps leave as much light whichever way they are split, and rays as much as the path tracer."""
    scene = lattice()
    adaptive = renderer(SIZE, "hemisphere").render(scene, vpls=64).radiance
    pre = renderer(SIZE, "hemisphere", set={"shadow_maps.tessellation": "pre"}).render(scene, vpls=64).radiance
    np.testing.assert_allclose(adaptive.mean(), pre.mean(), rtol=1e-3)
    truth, closed = (trace(one) for one in (scene, lattice(cutoff=None)))
    many = renderer(SIZE, "accurate").render(scene, vpls=256).radiance
    assert many.mean() == pytest.approx(truth.mean(), rel=0.01)
    off = [np.abs(image - truth).mean() for image in (many, closed)]
    assert off[0] < 0.2 * off[1]


def test_a_scene_all_of_holes(renderer):
    """No triangle is whole: maps have nothing else to draw."""
    scene = lattice()
    only = replace(scene, materials=(replace(scene.materials[0], alpha_cutoff=0.5), scene.materials[1]))
    found = renderer(SIZE, "deferred").render(only, vpls=8).radiance
    expected = renderer(SIZE, "deferred").render(scene, vpls=8).radiance
    np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-5)


def test_less_alpha_than_the_threshold_takes_all_away(renderer):
    scene = lattice()
    gone = replace(scene, materials=(scene.materials[0], replace(scene.materials[1], alpha=0.4)))
    bare = replace(
        scene,
        geometry=replace(
            scene.geometry, faces=scene.geometry.faces[:-2], face_materials=scene.geometry.face_materials[:-2]
        ),
    )
    first, second = (renderer(SIZE, "deferred").render(one, vpls=8).radiance for one in (gone, bare))
    np.testing.assert_allclose(first, second, rtol=1e-4, atol=1e-5)


@pytest.mark.parametrize("graph", ["deferred", "forward", "hemisphere"])
def test_holes_move_with_their_model(renderer, graph):
    """The picture is that of the same triangles at rest where the motion has brought them."""
    scene = lattice()
    count = len(scene.geometry.positions)
    motion = ModelMotion((0.0, 1.0), ((0, 0, 0), (0.1, 0.2, -0.1)), ((0, 0, 0, 1.0), (0, 0.2588, 0, 0.9659)))
    model = Model("lattice", count - 4, 4, motion)
    moving = replace(scene, geometry=replace(scene.geometry, moving=(model,)), models=(model,))
    posed = moving.at(1.0)
    g = posed.geometry
    still = replace(posed, geometry=Geometry(g.positions, g.faces, g.face_materials, g.normals, g.uvs), models=())
    one = renderer(SIZE, graph)
    one.render(moving, vpls=8)
    found = one.render(moving, vpls=8, time=1.0).radiance
    expected = renderer(SIZE, graph).render(still, vpls=8).radiance
    np.testing.assert_allclose(found, expected, rtol=1e-3, atol=1e-4)
