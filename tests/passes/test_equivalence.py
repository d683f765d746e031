"""Forward and deferred draw the same image: on every built-in scene, and under every option that both have."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from equivalence import SIZE, VPLS, assert_equivalent, hit_pixels, render_both
from small_scenes import crooked_room

from deferred_ir.gl import raw
from deferred_ir.loading.load import builtin_scenes, load
from deferred_ir.scene.scene import Scene

NEGATIVE_ONE_TO_ONE = 0x935E
ODD = """
o box
v -1 -1 -1
v 1 -1 -1
v 1 1 -1
v -1 1 -1
v -1 -1 1
v 1 -1 1
v 1 1 1
v -1 1 1
v -0.5 -1 -0.6
v 0.3 -1 -0.7
v 0.1 0.1 -0.3
v -0.2 -1 0.1
usemtl odd
f 1 2 3 4
f 1 5 6 2
f 4 3 7 8
usemtl darker
f 1 4 8 5
f 2 6 7 3
usemtl light
f 9 10 11
f 10 12 11
f 12 9 11
"""
ODD_MATERIALS = """
newmtl odd
Kd 0.1234 0.1234 0.1234
newmtl darker
Kd 0.03 0.1234 0.7071
newmtl light
Kd 0.9 0.03 0.333
"""
ODD_SCENE = """
[[model]]
path = "odd.obj"
[camera]
position = [0.1, 0.1, 2.6]
look_at = [0, -0.2, 0]
fov = 50
[spotlight]
position = [0.3, 0.9, 0.6]
look_at = [-0.2, -1, -0.2]
fov = 95
emission = [7, 6, 5]
"""


@lru_cache
def scene_named(name: str) -> Scene:
    return crooked_room() if name == "room" else load(name)


@pytest.mark.parametrize("name", [name for name, _ in builtin_scenes()])
@pytest.mark.parametrize("projection", ["perspective", "paraboloid"])
def test_on_built_in_scenes(renderer, name, projection):
    scene = scene_named(name)
    # Depth goes by interpolated map coordinates there, which round differently in a tile: a pixel or two at an edge.
    untrimmed = 1e-4 if projection == "paraboloid" else 1e-6
    assert_equivalent(
        *render_both(renderer, scene, {"shadow_maps.projection": projection}), hit_pixels(name, scene), untrimmed
    )


@pytest.mark.parametrize("fov", [139.0, 141.0, 179.0])
@pytest.mark.parametrize("kernel", [1.0, 9.0])
def test_with_a_wide_spotlight(renderer, fov, kernel):
    scene = scene_named("room")
    scene = replace(scene, lights=(replace(scene.spotlight, fov=fov),))
    assert_equivalent(*render_both(renderer, scene, {"shadow_maps.spot_kernel": kernel}), hit_pixels("room", scene))


@pytest.mark.parametrize("fov", [90.0, 150.0])
@pytest.mark.parametrize(
    "settings",
    [
        {},
        {"shadow_maps.soft": "off"},
        {"shadow_maps.search_taps": 5, "shadow_maps.soft_taps": 100, "shadow_maps.spot_size": 300},
        {"shadow_maps.spot_kernel": 9.0},
    ],
    ids=str,
)
def test_with_a_disc_for_a_spotlight(renderer, fov, settings):
    scene = scene_named("room")
    scene = replace(scene, lights=(replace(scene.spotlight, fov=fov, radius=0.15),))
    assert_equivalent(*render_both(renderer, scene, settings), hit_pixels("room", scene))


def test_on_albedos_that_are_not_exact_in_8_bits(renderer, tmp_path):
    (tmp_path / "odd.obj").write_text(f"mtllib odd.mtl\n{ODD}")
    (tmp_path / "odd.mtl").write_text(ODD_MATERIALS)
    (tmp_path / "odd.toml").write_text(ODD_SCENE)
    scene = load(tmp_path / "odd.toml")
    assert {material.base_color for material in scene.materials} == {
        (0.1234, 0.1234, 0.1234),
        (0.03, 0.1234, 0.7071),
        (0.9, 0.03, 0.333),
    }
    assert_equivalent(*render_both(renderer, scene), hit_pixels("odd", scene))


OPTIONS = [
    {"shadow_maps.vpl_size": 64},
    {"shadow_maps.vpl_size": 100},
    {"shadow_maps.spot_size": 300},
    {"shadow_maps.vpl_offset": 3.0, "shadow_maps.spot_offset": 2.0},
    {"shadow_maps.cull": "front"},
    {"shadow_maps.projection": "paraboloid"},
    {"shadow_maps.projection": "paraboloid", "vpl.fov": 179.9},
    {"shadow_maps.projection": "paraboloid", "vpl.fov": 60.0, "shadow_maps.bend": 0.25},
    {"shadow_maps.projection": "paraboloid", "shadow_maps.cull": "front", "shadow_maps.vpl_size": 100},
    {"shadow_maps.projection": "paraboloid", "shadow_maps.tessellation": "pre", "vpl.fov": 179.9},
    {"shadow_maps.projection": "paraboloid", "shadow_maps.tessellation": "pre", "shadow_maps.edge": 0.2},
    {"shadow_maps.spot_kernel": 7.0},
    {"shadow_maps.vpl_kernel": 5.0},
    {"shadow_maps.vpl_kernel": 12.0, "shadow_maps.vpl_taps": 20, "shadow_maps.vpl_size": 32},
    {"shadow_maps.vpl_kernel": 9.0, "shadow_maps.projection": "paraboloid", "vpl.fov": 179.9},
    {"vpl.fov": 60.0},
    {"vpl.fov": 175.0},
    {"vpl.clamp": 0.0},
    {"vpl.clamp": 0.2},
    {"vpl.bounces": 3},
    *({"vpl.pattern": pattern} for pattern in ("random", "stratified", "halton", "sobol")),
]


@pytest.mark.parametrize("settings", OPTIONS, ids=str)
def test_under_options_that_both_share(renderer, settings):
    scene = scene_named("room")
    assert_equivalent(*render_both(renderer, scene, settings), hit_pixels("room", scene))


@pytest.mark.parametrize("settings", OPTIONS, ids=str)
def test_those_options_do_something(renderer, settings):
    """Against the defaults, or a third value where the option is near its default."""
    others = {"vpl.pattern": "random" if settings == {"vpl.pattern": "sobol"} else "sobol", "vpl.clamp": 0.1}
    default = {key: value for key, value in others.items() if key in settings}
    one, other = (renderer((48, 48), set=chosen).render(scene_named("room"), vpls=16) for chosen in (settings, default))
    assert not np.array_equal(one.radiance, other.radiance)


@pytest.mark.parametrize("lights", [1, 3, 8])
@pytest.mark.parametrize("name", ["room", "cornell"])
def test_with_any_number_of_lights_in_a_draw(renderer, lights, name):
    scene = scene_named(name)
    forward = {"forward.lights_per_draw": lights}
    assert_equivalent(*render_both(renderer, scene, forward=forward), hit_pixels(name, scene))


@pytest.mark.parametrize("lights", [1, 7])
def test_with_more_lights_than_a_block_holds(renderer, lights):
    scene = scene_named("room")
    settings, forward = {"shadow_maps.vpl_size": 64}, {"forward.lights_per_draw": lights}
    assert_equivalent(*render_both(renderer, scene, settings, forward=forward, vpls=260), hit_pixels("room", scene))


def without_clip_control(one):
    """As on a driver that has not GL_ARB_clip_control: depth from -1 to 1, fragments write it themselves."""
    with one.gpu.ctx:
        one.gpu.gl.ClipControl(raw.LOWER_LEFT, NEGATIVE_ONE_TO_ONE)
    one.gpu.clip_control = False


def without_layers_from_vertex(one):
    one.gpu.layer_from_vertex = False


@pytest.mark.parametrize("name", ["room", "colors"])
@pytest.mark.parametrize("prepare", [without_clip_control, without_layers_from_vertex])
@pytest.mark.parametrize("projection", ["perspective", "paraboloid"])
def test_on_drivers_that_offer_less(renderer, name, prepare, projection):
    scene, settings = scene_named(name), {"shadow_maps.projection": projection}
    deferred, forward = render_both(renderer, scene, settings, prepare=prepare)
    assert_equivalent(deferred, forward, hit_pixels(name, scene))
    full = renderer(SIZE, set=settings).render(scene, vpls=VPLS, seed=1).radiance
    assert_equivalent(deferred, full, hit_pixels(name, scene), untrimmed=1e-5)
