"""Gloss of direct lights and of VPLs: forward as deferred, and both as brdf.py says."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from equivalence import SIZE, assert_equivalent, render_both
from small_scenes import build, plane, room
from surface_scenes import glossy_room, lattice, mapped_plane

from deferred_ir.profiling.light_scenes import SCENES
from deferred_ir.rays.direct import irradiate
from deferred_ir.rays.tracer import Tracer
from deferred_ir.scene.camera import Camera
from deferred_ir.scene.lights.directional import Directional
from deferred_ir.scene.lights.point import Point
from deferred_ir.scene.lights.spot import Spot
from deferred_ir.scene.surfaces import brdf
from deferred_ir.scene.surfaces.materials import Material, Sampler, Texture, TextureRef
from deferred_ir.truth.path_tracer import PathTracer

HIT = np.ones(SIZE[::-1], bool)
LIGHTS = {
    "spotlight": glossy_room().spotlight,
    "point": Point((-0.4, 0.6, 0.3), (2.0, 2.5, 3.0)),
    "spot": Spot((-0.4, 0.9, 0.3), (0.1, -1.0, -0.1), 100.0, intensity=(3.0, 2.5, 2.0)),
    "directional": Directional((0.3, 0.9, 0.6), (0.0, 0.0, 0.0), (3.0, 2.5, 2.0)),  # on a floor under the sky
}


def make_glossy(scene):
    """Metal with some roughness on every other material, plastic on the rest."""
    pairs = [(1.0, 0.25), (0.0, 0.4)]
    materials = tuple(
        replace(material, metallic=pairs[i % 2][0], roughness=pairs[i % 2][1], specular=1.0)
        for i, material in enumerate(scene.materials)
    )
    return replace(scene, materials=materials)


def glossy_light(name):
    return replace(mapped_plane() if name == "directional" else glossy_room(), lights=(LIGHTS[name],))


def reflect(scene, light, size=SIZE):
    """Direct light by rays and brdf.py, (H, W, 3)."""
    tracer = Tracer(scene)
    every = PathTracer(scene, tracer).trace_camera_rays(size)
    image, hit = np.zeros((len(every.face), 3)), np.flatnonzero(every.hit)
    seen = every.rows(hit)
    arriving = irradiate(light, tracer, seen, None) * np.asarray(light.emission)
    to_viewer = np.asarray(scene.camera.position) - seen.position
    to_viewer /= np.linalg.norm(to_viewer, axis=1, keepdims=True)
    to_light = light.sample(seen.position, None, scene.bounds).to
    to_light = to_light / np.linalg.norm(to_light, axis=1, keepdims=True)
    kept, glossy = brdf.eval(seen.gloss, seen.shading_normal, to_viewer, to_light)
    image[hit] = arriving * (seen.albedo / np.pi * kept[:, None] + glossy)
    return image.reshape(size[1], size[0], 3)


@pytest.mark.parametrize(
    "scene",
    [
        glossy_room(),
        glossy_room(roughness=0.0),
        mapped_plane(),
        make_glossy(lattice()),
        make_glossy(SCENES["mixture"]()),
    ],
    ids=["room", "a mirror", "images", "holes", "lights of many kinds"],
)
def test_forward_is_deferred_on_glossy_surfaces(renderer, scene):
    assert_equivalent(*render_both(renderer, scene, vpls=32), HIT, untrimmed=1e-4)


@pytest.mark.parametrize("name", LIGHTS)
def test_direct_light_is_reflected_as_the_brdf_says(renderer, name):
    scene = glossy_light(name)
    found = renderer(SIZE, "deferred").render(scene, vpls=0).radiance
    expected = reflect(scene, LIGHTS[name])
    off = np.abs(found - expected).max(axis=2) / (expected.max(axis=2) + 0.01 * expected.mean())
    # The G-buffer keeps base colours in half floats; between texels the hardware's weights have 8 bits.
    assert np.median(off) < (2e-3 if scene.textures else 7e-4)
    assert (off > 0.02).mean() < 0.03  # borders of shadows


@pytest.mark.parametrize("lights", [2, 4, 8])
def test_several_vpls_a_draw_are_the_same_on_textures(renderer, lights):
    """Beside array textures, a driver must not be asked for a map by a number that is no constant."""
    scene = mapped_plane()
    scene = replace(scene, materials=(replace(scene.materials[0], metallic=0.0, specular=0.0),))
    one, many = (
        renderer(SIZE, "forward", set={"forward.lights_per_draw": count}).render(scene, vpls=10).radiance
        for count in (1, lights)
    )
    np.testing.assert_allclose(many, one, rtol=1e-5, atol=1e-7)


def test_matt_numbers_are_lambert(renderer):
    """A scene drawn by the glossy shaders, whose surfaces have no gloss left, is the matt one."""
    scene = room()
    expected = renderer(SIZE, "deferred").render(scene, vpls=16).radiance
    shiny = replace(scene.materials[0], specular=1e-30)
    found = renderer(SIZE, "deferred").render(replace(scene, materials=(shiny, scene.materials[1])), vpls=16).radiance
    assert "gbuffer.material" not in renderer(SIZE, "deferred").plan(replace(scene, materials=(shiny,) * 2), 4).left_out
    np.testing.assert_allclose(found, expected, rtol=2e-5, atol=1e-7)


@pytest.mark.parametrize("roughness", [0.0, 1e-4, 0.03, 0.3, 1.0])
@pytest.mark.parametrize("metallic", [0.0, 1.0])
def test_vpls_make_no_spikes(renderer, roughness, metallic):
    """The brightest pixel stays within a hundred times the mean, whatever the roughness; a mirror, too."""
    scene = glossy_room(roughness=roughness, metallic=metallic, specular=1.0)
    one = renderer(SIZE, "deferred")
    indirect = one.render(scene, vpls=64).radiance - one.render(scene, vpls=0).radiance
    assert np.isfinite(indirect).all()
    assert indirect.max() < 100 * indirect.mean()


def test_a_black_metal_reflects_at_grazing_angles_alone(renderer):
    floor = build(plane(3.0), camera=Camera((0.0, 0.05, 3.0), (0.0, 0.0, 0.0)), spotlight=room().spotlight)
    black = Material("black", (0.0, 0.0, 0.0), metallic=1.0, roughness=0.3)
    found = renderer(SIZE, "deferred").render(replace(floor, materials=(black,)), vpls=0).radiance
    assert np.isfinite(found).all()
    assert found.min() >= 0
    assert found.max() > 0


def stripes(**sampler):
    """A floor of thin stripes that goes far away."""
    scene = build(plane(20.0), camera=Camera((0.0, 0.5, 19.0), (0.0, 0.0, 10.0)), spotlight=room().spotlight)
    pixels = np.zeros((64, 64, 3), np.uint8)
    pixels[:, ::2] = 255
    uvs = np.float32([[0, 0], [30, 0], [30, 30], [0, 30]])
    texture = TextureRef(0, sampler=Sampler(**sampler))
    floor = replace(scene.materials[0], base_color=(1.0, 1.0, 1.0), base_color_texture=texture)
    geometry = replace(scene.geometry, uvs=uvs)
    return replace(scene, geometry=geometry, materials=(floor,), textures=(Texture("stripes", pixels),))


def far_contrast(one, scene):
    """Standard deviation of base colour in rows just below the horizon."""
    one.draw(scene, one.plan(scene, 4))
    with one.gpu.ctx:
        image = one.executor.resource(("gbuffer", "albedo")).read()[..., 0]
        depth = one.executor.resource(("gbuffer", "depth")).read()[..., 0]
    rows = np.flatnonzero((depth > 0).all(axis=1))[-6:]
    return image[rows].std()


def test_mipmaps_filter_what_is_far_where_a_file_or_the_user_asks_for_them(renderer):
    plain = far_contrast(renderer(SIZE, "deferred"), stripes())
    assert plain > 0.2
    assert far_contrast(renderer(SIZE, "deferred"), stripes(mipmaps="linear")) < 0.3 * plain
    assert far_contrast(renderer(SIZE, "deferred", set={"gbuffer.mipmaps": "always"}), stripes()) < 0.3 * plain
    never = renderer(SIZE, "deferred", set={"gbuffer.mipmaps": "never"})
    assert far_contrast(never, stripes(mipmaps="linear")) == plain


def test_a_thousand_materials_are_drawn_in_a_few_calls(renderer):
    """Their images are layers of two arrays, so there are two draw calls, and each quad has its own colour."""
    count, side = 1000, 32
    rng = np.random.default_rng(3)
    colors = rng.integers(30, 256, (count, 3)).astype(np.uint8)
    x, z = np.divmod(np.arange(count), side)
    corners = np.array([[0, 0, 1], [1, 0, 1], [1, 0, 0], [0, 0, 0]], float)
    positions = (np.stack([x, 0 * x, z], axis=1)[:, None] + corners).reshape(-1, 3) / side - [0.5, 0, 0.5]
    faces = (4 * np.arange(count)[:, None, None] + np.array([[0, 1, 2], [0, 2, 3]])).reshape(-1, 3).astype("i4")
    base = build(plane(), camera=Camera((0.0, 0.6, 0.001), (0.0, 0.0, 0.0), fov=80.0), spotlight=room().spotlight)
    sizes = [(4, 4) if i < 500 else (8, 2) for i in range(count)]
    textures = tuple(Texture(str(i), np.tile(colors[i], (*sizes[i], 1))) for i in range(count))
    scene = replace(
        base,
        geometry=replace(
            base.geometry,
            positions=positions,
            faces=faces,
            face_materials=np.repeat(np.arange(count), 2).astype("i4"),
            uvs=np.tile(np.float32([[0, 0], [1, 0], [1, 1], [0, 1]]), (count, 1)),
        ),
        materials=tuple(Material(str(i), (1.0, 1.0, 1.0), TextureRef(i)) for i in range(count)),
        textures=textures,
    )
    one = renderer((192, 192), "deferred")
    one.draw(scene, one.plan(scene, 0))
    assert len(one._buffers._runs) == 2
    with one.gpu.ctx:
        image = one.executor.resource(("gbuffer", "albedo")).read()[..., :3]
    seen = PathTracer(scene, Tracer(scene)).trace_camera_rays((192, 192))
    expected = seen.albedo.reshape(192, 192, 3)[::-1]
    assert (np.abs(image - expected).max(axis=2) > 0.002).mean() < 0.02
