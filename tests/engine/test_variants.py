"""Shaders have no code for what a scene has not, and show the same for it; what is compiled is what is new."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from distance import same_pixels
from small_scenes import build, plane, room, smooth_scene, textured

from deferred_ir.scene.camera import Camera
from deferred_ir.scene.scene import Scene

SIZE = (48, 40)
FEW = {"vpl.count": 6, "shadow_maps.spot_size": 128, "shadow_maps.vpl_size": 32}


def floor() -> Scene:
    """One material with an image on it."""
    pixels = np.random.default_rng(3).integers(0, 256, (8, 8, 3))
    scene = build(plane(), camera=Camera((0.0, 1.2, 1.5), (0.0, 0.0, 0.0)))
    return textured(scene, pixels, scene.geometry.positions[:, [0, 2]])


def partly_textured() -> Scene:
    scene = room()
    pixels = np.random.default_rng(4).integers(0, 256, (8, 8, 3))
    return textured(scene, pixels, scene.geometry.positions[:, :2])


def coloured() -> Scene:
    scene = smooth_scene()
    colors = np.random.default_rng(5).uniform(0.1, 1, scene.geometry.positions.shape).astype("f4")
    return replace(scene, geometry=replace(scene.geometry, colors=colors))


def wide() -> Scene:
    return replace(room(), lights=(replace(room().spotlight, fov=160.0),))


def disc() -> Scene:
    return replace(smooth_scene(), lights=(replace(smooth_scene().spotlight, radius=0.1),))


SCENES = {made.__name__: made for made in (floor, partly_textured, room, smooth_scene, coloured, wide, disc)}


def pictures(renderer, graph, **settings):
    """With variants and without, of every scene in one Renderer each."""
    variants = renderer(SIZE, graph, set={**FEW, **settings})
    general = renderer(SIZE, graph, set={**FEW, **settings}, keep_all=True)
    return {name: (variants.render(made()), general.render(made())) for name, made in SCENES.items()}


@pytest.mark.parametrize("graph", ["forward", "deferred", "interleaved"])
def test_no_pixel_depends_on_the_variant(renderer, graph):
    for name, (image, general) in pictures(renderer, graph).items():
        assert image.radiance.max() > 0.01, name
        assert same_pixels(image, general), name


@pytest.mark.parametrize("operator", ["neutral", "reinhard", "aces", "none"])
def test_nor_on_that_of_clamp_and_tone_curve(renderer, operator):
    exposure = {"tonemap.operator": operator, "tonemap.exposure": 1.5 if operator == "aces" else "auto"}
    settings = {**FEW, "vpl.clamp": 0.0, **exposure}
    image, general = (
        renderer(SIZE, "deferred", set=settings, keep_all=keep_all).render(smooth_scene()) for keep_all in (False, True)
    )
    assert image.display.max() > 10
    assert same_pixels(image, general)


def test_a_scene_compiles_only_what_no_scene_before_it_needed(renderer):
    one = renderer(SIZE, "deferred", set=FEW)
    library = one.executor.library

    def compiled(scene, **options):
        before = library.compiled
        one.render(scene, **options)
        return library.compiled - before

    assert compiled(room()) == 6  # G-buffer, maps of direct lights and of VPLs, lists of tiles, lighting, tone map
    assert compiled(room(), seed=5, time=1.0) == 0
    assert compiled(smooth_scene()) == 2  # G-buffer, lighting
    assert compiled(partly_textured()) == 1  # G-buffer
    assert compiled(disc()) == 1  # lighting
    for made in (room, smooth_scene, partly_textured, disc):
        assert compiled(made()) == 0


def test_without_a_clamp_or_shading_normals_shaders_do_not_name_them(renderer):
    one = renderer(SIZE, "deferred", set={**FEW, "vpl.clamp": 0.0})
    one.render(room())
    defines = [dict(key[2]) for key in one.executor.library._programs if key[0] == ("lighting.frag",)]
    assert [(d["CLAMPED"], d["SMOOTH"], d["DISC"], d["VIEWS_PROJECTION"]) for d in defines] == [(0, 0, 0, 0)]
