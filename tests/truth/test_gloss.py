"""The path tracer's gloss: its formulas against those of renders, and images against integrals of the model."""

from dataclasses import replace

import numpy as np
import pytest
from small_scenes import build, plane, quad
from surface_scenes import glossy_room, mapped_plane

from deferred_ir.rays.tracer import Hits, Tracer
from deferred_ir.scene.camera import Camera
from deferred_ir.scene.lights.directional import Directional
from deferred_ir.scene.lights.disc import Disc
from deferred_ir.scene.lights.environment import Environment
from deferred_ir.scene.lights.point import Point
from deferred_ir.scene.lights.rect import Rect
from deferred_ir.scene.lights.sphere import Sphere
from deferred_ir.scene.lights.spotlight import Spotlight
from deferred_ir.scene.surfaces import brdf
from deferred_ir.scene.surfaces.brdf import Gloss
from deferred_ir.scene.surfaces.materials import Sampler, Texture, TextureRef
from deferred_ir.scene.surfaces.texture_lookup import find_uvs, sample_texture
from deferred_ir.truth.path_tracer import PathTracer
from deferred_ir.truth.reference import trace_reference
from deferred_ir.truth.reflection import Receivers
from deferred_ir.truth.textures import look_up

COUNT = 20000
GRAZING = Camera((0.0, 0.6, 2.0), (0.0, 0.0, 0.0), fov=40.0)
EVERYWHERE = Environment(radiance=(1.0, 1.0, 1.0))


def draw_unit(rng, count=COUNT):
    vectors = rng.normal(size=(count, 3))
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def make_receivers(rng):
    normal, viewer = draw_unit(rng), draw_unit(rng)
    gloss = Gloss(rng.random((COUNT, 3)), rng.random(COUNT), rng.random((COUNT, 2)), 10 ** rng.uniform(-3, 0, COUNT))
    zero = np.zeros((COUNT, 3))
    return Receivers(Hits(np.zeros(COUNT, np.int32), zero, normal, normal, zero, gloss), viewer, True)


def test_the_path_tracers_formulas_are_the_model():
    rng = np.random.default_rng(1)
    at = make_receivers(rng)
    gloss, normal = at.hits.gloss, at.hits.shading_normal
    upper = np.einsum("ij,ij->i", normal, at.to_viewer) > 1e-3
    for light in (draw_unit(rng), at.draw(rng.random((COUNT, 2)))):
        kept, glossy = brdf.eval(gloss, normal, at.to_viewer, light)
        apart = np.linalg.norm(at.to_viewer + light, axis=1) > 1e-3
        np.testing.assert_allclose(at.keep(light)[apart], kept[apart], rtol=1e-9)
        np.testing.assert_allclose(at.reflect(light)[apart], glossy[apart], rtol=1e-9)
        density = brdf.pdf(gloss, normal, at.to_viewer, light)
        both = apart & upper
        np.testing.assert_allclose(at.find_density(light)[both], density[both], rtol=1e-9)
        assert (glossy[both] > 0).any(axis=1).mean() > 0.2


@pytest.mark.parametrize("cosine", [1.0, 0.5, 0.05, -0.3])
@pytest.mark.parametrize("alpha", [0.02, 0.2, 1.0])
def test_directions_have_the_density_that_is_stated(alpha, cosine):
    """Their share of each cell of a grid about the normal is the integral of the density over the cell."""
    rng, count, cells = np.random.default_rng(2), 200_000, 12
    normal = np.tile([0.0, 0.0, 1.0], (count, 1))
    viewer = np.tile([np.sqrt(1 - cosine**2), 0.0, cosine], (count, 1))
    gloss = Gloss(np.ones((count, 3)), np.ones(count), np.zeros((count, 2)), np.full(count, alpha))
    zero = np.zeros((count, 3))
    at = Receivers(Hits(np.zeros(count, np.int32), zero, normal, normal, zero, gloss), viewer, True)
    # A grid about the mirrored direction, finer where the lobe is narrow.
    mirrored = np.array([-np.sqrt(1 - cosine**2), 0.0, abs(cosine)])
    side, up = np.array([0.0, 1.0, 0.0]), np.cross(mirrored, [0.0, 1.0, 0.0])
    reach = min(4 * alpha, 1.0)

    def place(ways):
        return np.stack([ways @ side, ways @ up], axis=1) / reach

    drawn = at.draw(rng.random((count, 2)))
    drawn = drawn[(drawn[:, 2] > 0) & (drawn @ mirrored > 0)]
    found, *_ = np.histogramdd(place(drawn), bins=[np.linspace(-1, 1, cells + 1)] * 2)
    square = rng.uniform(-1, 1, (count, 2)) * reach
    along = np.sqrt(np.maximum(1 - (square**2).sum(axis=1), 1e-12))
    ways = square[:, :1] * side + square[:, 1:] * up + along[:, None] * mirrored
    inside = ((square**2).sum(axis=1) < 1) & (ways[:, 2] > 0)
    weight = np.where(inside, at.find_density(ways) / along, 0) * (2 * reach) ** 2
    expected, *_ = np.histogramdd(square / reach, bins=[np.linspace(-1, 1, cells + 1)] * 2, weights=weight)
    squares, *_ = np.histogramdd(square / reach, bins=[np.linspace(-1, 1, cells + 1)] * 2, weights=weight**2)
    assert (np.abs(found - expected) <= 5 * np.sqrt(found + squares) + 5).all()
    assert found.sum() > 0.3 * count


def find_reflectance(material, cosine, side=300):
    """Return what a surface in a furnace of radiance 1 reflects towards `cosine`, (3,), by a lattice of directions."""
    across = (np.arange(side) + 0.5) / side
    points = np.stack(np.meshgrid(across, across), axis=-1).reshape(-1, 2)
    count = len(points)
    colour, one = np.array([material.base_color]), np.ones(1)
    albedo, gloss = brdf.make_gloss(
        [material], np.zeros(1, int), colour, one * material.metallic, one * material.roughness
    )
    gloss, normal = gloss.rows(np.zeros(count, int)), np.tile([0.0, 0.0, 1.0], (count, 1))
    viewer = np.tile([np.sqrt(1 - cosine**2), 0.0, cosine], (count, 1))
    glossy = brdf.sample(gloss, normal, viewer, points)[1].mean(axis=0)
    radius, angle = np.sqrt(points[:, 0]), 2 * np.pi * points[:, 1]
    ways = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.sqrt(1 - points[:, 0])], axis=1)
    return glossy + albedo[0] * brdf.eval(gloss, normal, viewer, ways)[0].mean()


@pytest.mark.parametrize("roughness", [0.0, 0.1, 0.3, 0.6, 1.0])
@pytest.mark.parametrize(
    "kind",
    [{"metallic": 1.0}, {"specular": 1.0}, {"metallic": 0.4, "specular": 0.7, "base_color": (0.9, 0.5, 0.2)}],
    ids=["white metal", "white plastic", "mixed"],
)
def test_a_plane_in_a_furnace_reflects_the_models_integral(kind, roughness):
    bare = build(plane(1.0, 0.0, (1.0, 1.0, 1.0)), camera=GRAZING)
    material = replace(bare.materials[0], roughness=roughness, **kind)
    scene = replace(bare, materials=(material,), lights=(EVERYWHERE,))
    estimate = PathTracer(scene, Tracer(scene)).estimate((5, 5), 400, seed=1)
    ways = -scene.camera.rays((5, 5))
    expected = find_reflectance(material, ways[2, 2, 1] / np.linalg.norm(ways[2, 2]))
    sigma = np.sqrt(estimate.variance[2, 2])
    assert (np.abs(estimate.direct[2, 2] - expected) <= 4 * sigma + 2e-4).all()
    assert sigma.max() < 5e-3
    assert not estimate.indirect.any()
    if "metallic" in kind:
        assert (estimate.direct[2, 2] <= 1 + 3 * sigma).all()


LIGHTS = {
    "rect": Rect((0.0, 0.6, -2.0), (0.0, 0.0, 0.0), (0.5, 0.5), radiance=(3.0, 2.0, 1.0)),
    "disc": Disc((0.0, 0.6, -2.0), (0.0, 0.0, 0.0), 0.3, (3.0, 2.0, 1.0)),
    "sphere": Sphere((0.0, 0.6, -2.0), 0.3, (3.0, 2.0, 1.0)),
    "ball": Point((0.0, 0.6, -2.0), (3.0 * np.pi * 0.09, 2.0 * np.pi * 0.09, np.pi * 0.09), 0.3),
    "sun": Directional((0.0, 0.6, -2.0), (0.0, 0.0, 0.0), tuple(np.array([3.0, 2.0, 1.0]) * np.pi * 0.25), 60.0),
    "spotlight": Spotlight(
        (0.0, 0.6, -2.0), (0.0, 0.0, 0.0), 160.0, tuple(np.array([3.0, 2.0, 1.0]) * np.pi * 0.09), 0.3
    ),
    "environment": Environment(radiance=(3.0, 2.0, 1.0)),
}


@pytest.mark.parametrize("kind", LIGHTS)
def test_a_mirror_shows_the_radiance_of_what_shines(kind):
    bare = build(plane(1.0, 0.0, (1.0, 1.0, 1.0)), camera=GRAZING)
    mirror = replace(bare.materials[0], metallic=1.0, roughness=0.0)
    scene = replace(bare, materials=(mirror,), lights=(LIGHTS[kind],))
    # Samples of the light find the far tails of the lobe, which are a hundredth of it, so a pixel alone is noisy.
    middle = trace_reference(scene, (65, 65), spp=64).direct[29:36, 29:36].mean(axis=(0, 1))
    np.testing.assert_allclose(middle, (3.0, 2.0, 1.0), rtol=5e-3)


@pytest.mark.parametrize("unlit", [False, True])
def test_a_mirror_shows_glowing_surfaces_and_unlit_ones_light_nothing(unlit):
    panel = quad((-0.5, 0.1, -1.5), (0.5, 0.1, -1.5), (0.5, 1.1, -1.5))
    bare = build(plane(1.0, 0.0, (1.0, 1.0, 1.0)), panel, plane(3.0, -0.5), camera=GRAZING)
    mirror = replace(bare.materials[0], metallic=1.0, roughness=0.0)
    glow = replace(bare.materials[1], base_color=(0.0, 0.0, 0.0), emission=(3.0, 2.0, 1.0), unlit=unlit)
    scene = replace(bare, materials=(mirror, glow, bare.materials[2]), lights=())
    made = trace_reference(scene, (65, 65), spp=64)
    np.testing.assert_allclose(made.direct[29:36, 29:36].mean(axis=(0, 1)), (3.0, 2.0, 1.0), rtol=5e-3)
    assert made.emission.any()
    below = made.direct[50:, 0]
    assert (below > 0).all() != unlit
    assert (below == 0).all() == unlit


def test_a_mirror_shows_a_matt_wall_as_the_camera_would_see_it():
    """The mirrored image of a wall is what a camera behind the mirror sees, with its bounces."""
    wall = quad((-2, 0.0, -1.5), (2, 0.0, -1.5), (2, 3.0, -1.5), (0.8, 0.5, 0.2))
    side = quad((1.2, 0.0, 2.0), (1.2, 3.0, 2.0), (1.2, 3.0, -1.5), (0.2, 0.9, 0.3))
    light = Spotlight((0.0, 1.2, 1.0), (0.3, 0.6, -1.5), 100.0, (3.0, 3.0, 3.0))
    bare = build(plane(1.0, 0.0, (1.0, 1.0, 1.0)), wall, side, camera=GRAZING, spotlight=light)
    mirror = replace(bare.materials[0], metallic=1.0, roughness=0.0)
    shown = trace_reference(replace(bare, materials=(mirror, *bare.materials[1:])), (33, 33), spp=256).indirect[16, 16]
    below = replace(GRAZING, position=(0.0, -0.6, 2.0), look_at=(0.0, 0.0, 0.0))
    open_floor = build(wall, side, quad((-1, 0, -1), (1, 0, -1), (1, 0, 1), (0.0, 0.0, 0.0)), spotlight=light)
    camera = replace(below, position=(0.0, 0.0001, 0.0), look_at=(0.0, 0.6, -2.0))
    seen = trace_reference(replace(open_floor, camera=camera), (33, 33), spp=256).radiance[16, 16]
    np.testing.assert_allclose(shown, seen, rtol=0.03)
    assert seen.min() > 0.005


def average_blocks(values, side=6):
    height, width, channels = values.shape
    return values.reshape(height // side, side, width // side, side, channels).mean(axis=(1, 3))


@pytest.mark.parametrize("few", [8, 1])
def test_both_ways_of_sampling_agree_where_surfaces_gleam(few, monkeypatch):
    bare = glossy_room(roughness=0.45)
    lights = (
        replace(bare.spotlight, radius=0.2),
        Rect((0.2, 0.95, -0.2), (0.1, -1.0, 0.0), (0.5, 0.3), (0.0, 0.0, -1.0), (2.0, 2.0, 2.0)),
        Sphere((-0.6, 0.4, -0.6), 0.1, (2.0, 3.0, 4.0)),
    )
    scene = replace(bare, lights=lights)
    monkeypatch.setattr("deferred_ir.truth.lighting.MOST_EACH", few)
    estimates = [PathTracer(scene, Tracer(scene)).estimate((24, 24), 100, seed=1)]
    for name, value in (("weigh_light", 1.0), ("weigh_bounce", 0.0)):
        monkeypatch.setattr(f"deferred_ir.truth.lighting.{name}", lambda a, b, value=value: np.full(len(a), value))
    estimates.append(PathTracer(scene, Tracer(scene)).estimate((24, 24), 400, seed=2))
    one, other = (average_blocks(estimate.direct + estimate.indirect) for estimate in estimates)
    variance = sum(average_blocks(estimate.variance) for estimate in estimates) / 36
    assert (np.abs(one - other) <= 4 * np.sqrt(variance)).all()
    assert one.mean() == pytest.approx(other.mean(), rel=0.01)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
@pytest.mark.parametrize("magnify", ["nearest", "linear"])
@pytest.mark.parametrize("wrap", [("repeat", "mirror"), ("clamp", "repeat"), ("mirror", "clamp")])
def test_the_path_tracers_textures_are_those_of_renders(wrap, magnify, dtype):
    rng = np.random.default_rng(4)
    scene = mapped_plane()
    pixels = rng.integers(0, np.iinfo(dtype).max + 1, (5, 7, 4)).astype(dtype)
    scene = replace(scene, textures=(Texture("image", pixels),))
    image = TextureRef(0, uv_set=1, transform=(0.9, 2.1, -0.7, -1.7, 0.4, 1.3), sampler=Sampler(wrap, magnify))
    faces, weights = rng.integers(0, 2, 500), rng.dirichlet(np.ones(3), 500)
    uvs = find_uvs(scene.geometry, image, faces, weights)
    expected = sample_texture(scene.textures[0], uvs, image.sampler, channels=4)
    np.testing.assert_allclose(look_up(scene, image, faces, weights), expected, atol=1e-6)


def test_what_is_cut_out_of_a_glowing_surface_does_not_shine():
    """A panel with a hole that its alpha says lights a floor as one whose emission is black there."""
    bare = build(plane(1.0), quad((-0.5, 0.8, -0.5), (0.5, 0.8, -0.5), (0.5, 0.8, 0.5)), camera=GRAZING)
    floor, panel = bare.materials
    uvs = np.zeros((8, 2), np.float32)
    uvs[4:] = [[0, 0], [1, 0], [1, 1], [0, 1]]
    pixels = np.full((8, 8, 4), 255, np.uint8)
    pixels[:, :5, 3] = 0
    black = pixels[..., :3] * (pixels[..., 3:] > 0)
    image = TextureRef(0, sampler=Sampler(magnify="nearest"))
    scene = replace(bare, geometry=replace(bare.geometry, uvs=uvs), lights=())
    glow = replace(panel, emission=(3.0, 2.0, 1.0))
    cut = replace(glow, base_color_texture=image, alpha_cutoff=0.5)
    dark = replace(glow, emission_texture=image)
    one = trace_reference(
        replace(scene, materials=(floor, cut), textures=(Texture("holes", pixels),)), (8, 8), spp=64, bounces=0
    )
    other = trace_reference(
        replace(scene, materials=(floor, dark), textures=(Texture("dark", black),)), (8, 8), spp=64, bounces=0
    )
    np.testing.assert_allclose(one.direct, other.direct, rtol=1e-6)
    assert one.direct.any()
