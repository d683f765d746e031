"""References against closed forms and against each other."""

import ast
from dataclasses import asdict, replace

import numpy as np
import pytest
from small_scenes import Mesh, box, build, plane, quad, room, scaled, sphere
from source_imports import MODULES, imports

from deferred_ir.base.errors import SettingError
from deferred_ir.graph.file import load_graph
from deferred_ir.rays.tracer import Tracer
from deferred_ir.scene.camera import Camera
from deferred_ir.scene.lights.spotlight import Spotlight
from deferred_ir.truth.path_tracer import PathTracer
from deferred_ir.truth.reference import estimate_errors, make_vpl_params, trace_reference

ABOVE = Camera((0.0, 3.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, -1.0), fov=30.0)
UNCLAMPED = {"vpl.clamp": 0.0, "vpl.fov": 180}


def make_path_tracer(scene, **options):
    return PathTracer(scene, Tracer(scene), **options)


def find_floor_points(size, height=3.0, fov=30.0):
    """Return where the pixels of ABOVE meet y = 0: x and z, (H, W) each."""
    half = height * np.tan(np.radians(fov) / 2)
    x = ((np.arange(size) + 0.5) / size * 2 - 1) * half
    return np.meshgrid(x, x)


def compute_irradiance(source, look_at, fov, emission, points):
    """Return E cos(theta) cone(theta) cos_x / d^2 at points (..., 3) of the floor y = 0, by docs/conventions.md."""
    axis = np.subtract(look_at, source) / np.linalg.norm(np.subtract(look_at, source))
    way = points - source
    distance = np.linalg.norm(way, axis=-1)
    cosine = (way @ axis) / distance
    edge = np.cos(np.radians(fov / 2))
    cone = np.clip(4 * (cosine - edge) / (1 - edge), 0, 1)
    facing = -way[..., 1] / distance
    return emission * (np.maximum(cosine, 0) * cone * facing / distance**2)[..., None]


def average_blocks(values, side):
    height, width, channels = values.shape
    return values.reshape(height // side, side, width // side, side, channels).mean(axis=(1, 3))


@pytest.fixture(scope="module")
def lit_floor():
    light = Spotlight((0.3, 1.2, -0.2), (0.0, 0.0, 0.1), 50.0, (3.0, 2.0, 1.0))
    return build(plane(albedo=(0.8, 0.5, 0.2)), camera=ABOVE, spotlight=light)


@pytest.mark.parametrize("kind", [{"spp": 1}, {"vpls": 4}])
def test_direct_light_on_a_plane_is_the_closed_form(lit_floor, kind):
    light = lit_floor.spotlight
    made = trace_reference(lit_floor, (32, 32), **kind)
    x, z = find_floor_points(32)
    points = np.stack([x, np.zeros_like(x), z], axis=-1)
    expected = compute_irradiance(light.position, light.look_at, light.fov, np.array(light.emission), points)
    np.testing.assert_allclose(
        made.direct, expected * (0.8, 0.5, 0.2) / np.pi, rtol=1e-5, atol=2e-6
    )  # hits in single precision
    assert (made.direct > 0).any()
    assert not made.indirect.any()  # a plane alone sends no light to itself
    np.testing.assert_array_equal(made.radiance, made.direct)


def test_no_light_arrives_from_behind_a_surface(lit_floor):
    below = replace(lit_floor.spotlight, position=(0.3, -1.2, -0.2))
    assert not trace_reference(replace(lit_floor, lights=(below,)), (8, 8), spp=4).radiance.any()


def test_a_blocker_casts_its_shadow(lit_floor):
    lid = quad((-2, 1.0, 2), (2, 1.0, 2), (2, 1.0, -2))
    scene = build(plane(), lid, camera=replace(ABOVE, position=(0.0, 0.9, 0.0)), spotlight=lit_floor.spotlight)
    assert not trace_reference(scene, (8, 8), spp=1, bounces=0).radiance.any()


def test_a_disc_light_is_the_mean_of_its_points():
    light = Spotlight((0.2, 1.0, 0.0), (0.2, 0.0, 0.0), 120.0, (2.0, 2.0, 2.0), radius=0.4)
    edge = quad((0.2, 0.5, 1), (1.2, 0.5, 1), (1.2, 0.5, -1))  # half of the disc is hidden, its edge soft
    camera = Camera((-0.9, 2.0, 0.0), (-0.2, 0.0, 0.0), fov=25.0)
    scene = build(plane(2.0), edge, camera=camera, spotlight=light)
    tracer = PathTracer(scene, Tracer(scene), bounces=0)
    estimate = tracer.estimate((16, 16), 2500, seed=3)
    at = tracer.trace_camera_rays((16, 16)).position.reshape(16, 16, 3)
    on_floor = np.abs(at[..., 1]) < 1e-6
    # Concentric rings of equal area: midpoints in radius^2 and angle.
    steps = 64
    radius = 0.4 * np.sqrt((np.arange(steps) + 0.5) / steps)
    angle = (np.arange(steps) + 0.5) / steps * 2 * np.pi
    expected = np.zeros_like(at)
    for r in radius:
        for a in angle:
            source = np.array([0.2 + r * np.cos(a), 1.0, r * np.sin(a)])
            crossing = source[0] + (at[..., 0] - source[0]) * 0.5  # x halfway down, where the edge is
            seen = np.where(crossing < 0.2, 1.0, 0.0)[..., None]
            expected += compute_irradiance(source, source - (0, 1, 0), 120.0, np.full(3, 2.0), at) * seen
    expected *= 0.5 / np.pi / steps**2
    penumbra = on_floor & (at[..., 0] > -0.15) & (at[..., 0] < 0.55)
    assert penumbra.sum() > 30
    assert on_floor.sum() > 200
    sigma = np.sqrt(estimate.variance[on_floor])
    off = np.abs(estimate.direct - expected)[on_floor]
    assert off.max() < 0.02 * expected.max()
    assert (off <= 4 * sigma + 2e-3 * expected.max()).all()
    assert np.sqrt(estimate.variance[penumbra]).mean() > 0


def make_sphere_scene(albedo, radius=1.5):
    """Return a sphere that is seen and lit from inside, close to the middle."""
    camera = Camera((0.0, 0.1, 0.0), (0.5, 0.4, -1.0), fov=90.0)
    light = Spotlight((0.05, 0.0, 0.0), (1.0, 0.1, 0.0), 110.0, (3.0, 2.0, 1.0))
    return build(sphere(radius, 5, (albedo,) * 3), camera=camera, spotlight=light)


def compute_first_bounce(scene, radius=1.5):
    """Return the first bounce's radiance inside a sphere: the power, spread evenly, times albedo, twice over pi."""
    light, rho = scene.spotlight, scene.materials[0].base_color[0]
    edge = np.cos(np.radians(light.fov / 2))
    cosine = np.linspace(edge, 1, 200001)
    cone = np.clip(4 * (cosine - edge) / (1 - edge), 0, 1)
    power = 2 * np.pi * np.trapezoid(cosine * cone, cosine) * np.array(light.emission)
    return rho * rho * power / (4 * np.pi * radius**2) / np.pi


def test_the_first_bounce_inside_a_sphere_is_constant():
    scene = make_sphere_scene(0.6)
    expected = compute_first_bounce(scene)
    made = trace_reference(scene, (16, 16), vpls=1024, settings=UNCLAMPED)
    np.testing.assert_allclose(made.indirect / expected, 1, rtol=0.01)
    assert (made.indirect / expected).mean() == pytest.approx(1, rel=3e-3)


@pytest.mark.parametrize("bounces", [1, 2, 4])
@pytest.mark.slow
def test_bounces_inside_a_sphere_are_the_geometric_series(bounces):
    scene, rho = make_sphere_scene(0.6), 0.6
    expected = compute_first_bounce(scene) * sum(rho**k for k in range(bounces))
    estimate = make_path_tracer(scene, bounces=bounces).estimate((32, 32), 64)
    assert estimate.hit.all()
    ratio = (estimate.indirect / expected).mean()
    sigma = np.sqrt((estimate.variance / expected**2).sum()) / estimate.variance.size
    # The channels of a pixel share their paths; the sphere's facets cost it 2e-3.
    assert abs(ratio - 1) < 3 * np.sqrt(3) * sigma + 2e-3
    assert sigma < 3e-3
    by_vpls = trace_reference(scene, (16, 16), vpls=1024, bounces=bounces, settings=UNCLAMPED).indirect / expected
    assert by_vpls.mean() == pytest.approx(1, rel=1e-2)


def test_without_bounces_only_direct_light_is_left():
    for kind in ({"spp": 4}, {"vpls": 4}):
        made = trace_reference(room(), (8, 8), bounces=0, **kind)
        assert not made.indirect.any()
        assert made.direct.any()


@pytest.mark.parametrize(
    ("clamp", "fov", "smooth"),
    [(0.0, 180, False), (0.1, 180, False), (0.1, 120, True)],
    ids=["hemisphere", "clamped", "cone"],
)
@pytest.mark.slow
def test_paths_and_vpls_agree(clamp, fov, smooth):
    """Both estimate one integral: block means of the indirect light agree within their standard errors."""
    scene = room()
    if smooth:
        ball = sphere(0.3, 3, (0.3, 0.6, 0.9))
        ball = Mesh(np.add(ball.positions, (0.4, -0.6, -0.4)), ball.faces, ball.albedo, ball.normals)
        scene = build(box((-1, -1, -1), (1, 1, 1)), ball, camera=scene.camera, spotlight=scene.spotlight)
    size, side, seeds = (32, 32), 8, 8
    estimate = make_path_tracer(scene, clamp=clamp, fov=fov).estimate(size, 256)
    settings = {"vpl.clamp": clamp, "vpl.fov": fov}
    sets = [trace_reference(scene, size, vpls=512, seed=s, settings=settings).indirect for s in range(seeds)]
    blocks = np.array([average_blocks(one.astype(float), side) for one in sets])
    variance = blocks.var(axis=0, ddof=1) / seeds + average_blocks(estimate.variance, side) / side**2
    off = (blocks.mean(axis=0) - average_blocks(estimate.indirect, side)) / np.sqrt(variance)
    assert (np.abs(off) < 3).mean() >= 0.97
    assert np.abs(off).max() < 6
    mean = average_blocks(estimate.indirect, side).mean()
    assert blocks.mean() == pytest.approx(mean, rel=0.01)


@pytest.mark.slow
def test_the_stated_error_is_the_error():
    """The spread over seeds and the noise against a far better image are as one image states them."""
    scene = room()
    tracer = make_path_tracer(scene)
    made = [trace_reference(scene, (24, 24), spp=64, seed=seed) for seed in range(6)]
    spread = np.var([one.radiance for one in made], axis=0, ddof=1).mean()
    stated = np.mean([one.standard_error**2 for one in made])
    assert spread == pytest.approx(stated, rel=0.1)
    best = tracer.estimate((24, 24), 4096, seed=99)
    exact = best.direct + best.indirect
    noise = [np.mean((one.radiance - exact) ** 2 / (exact**2 + 0.01 * exact.mean() ** 2)) for one in made]
    assert np.mean([one.meta["noise"] for one in made]) == pytest.approx(np.mean(noise), rel=0.15)
    assert made[0].meta["standard_error"] == pytest.approx(made[0].standard_error.mean() / exact.mean(), rel=0.05)


def test_errors_of_a_known_image():
    radiance, hit = np.full((2, 2, 3), 2.0), np.array([[True, True], [True, False]])
    told = estimate_errors(radiance, np.full((2, 2, 3), 0.04), hit)
    assert told == pytest.approx({"standard_error": 0.1, "noise": 0.04 / 4.04})
    assert estimate_errors(radiance * 0, radiance * 0, hit) == {"standard_error": 0, "noise": 0}
    assert estimate_errors(radiance * 0, radiance * 0, hit & False) == {"standard_error": 0, "noise": 0}


@pytest.mark.parametrize("kind", [{"spp": 8, "bounces": 2}, {"vpls": 100, "bounces": 2}])
def test_the_same_image_for_any_number_of_threads(kind, monkeypatch):
    monkeypatch.setattr("deferred_ir.truth.path_tracer.RAYS", 512)
    monkeypatch.setattr("deferred_ir.vpls.ray_sum.PIXELS", 100)
    scene = replace(room(), lights=(replace(room().spotlight, radius=0.1),))
    images = [trace_reference(scene, (24, 16), threads=threads, **kind).radiance for threads in (1, 2, 5)]
    np.testing.assert_array_equal(images[0], images[1])
    np.testing.assert_array_equal(images[0], images[2])
    assert images[0].shape == (16, 24, 3)
    other = trace_reference(scene, (24, 16), seed=1, **kind).radiance
    assert np.abs(other - images[0]).max() > 0


@pytest.mark.parametrize("factor", [1e-3, 1e3, 1e8])
@pytest.mark.parametrize("kind", [{"spp": 4}, {"vpls": 64}])
def test_the_unit_of_length_does_not_matter(kind, factor):
    one, other = (trace_reference(scene, (16, 16), **kind).radiance for scene in (room(), scaled(room(), factor)))
    # Rays in single precision: a few grazing ones decide otherwise.
    assert np.median(np.abs(other - one)) < 1e-4 * one.mean()
    assert other.mean() == pytest.approx(one.mean(), rel=0.01)


def test_background_is_black_and_not_counted():
    scene = build(plane(0.2), camera=ABOVE)
    made = trace_reference(scene, (16, 16), spp=4)
    assert not made.radiance[~made.hit].any()
    assert 0 < made.hit.mean() < 1
    away = replace(scene, camera=replace(ABOVE, position=(0, -3, 0), look_at=(0, -4, 0)))
    for kind in ({"spp": 4}, {"vpls": 4}):
        assert not trace_reference(away, (4, 4), **kind).radiance.any()


def test_a_dark_light_gives_a_black_image():
    scene = replace(room(), lights=(replace(room().spotlight, emission=(0.0, 0.0, 0.0)),))
    for kind in ({"spp": 4}, {"vpls": 4}):
        assert not trace_reference(scene, (4, 4), **kind).radiance.any()


def test_the_path_tracer_shares_nothing_with_what_it_judges():
    shared = ("base.arrays", "base.colour", "base.parallel", "base.progress", "rays.tracer", "scene.scene")
    data = {"scene.surfaces.brdf": {"Gloss"}, "scene.surfaces.materials": {"Texture", "TextureRef", "Wrap"}}
    inner = ("truth.lighting", "truth.reflection", "truth.textures", "truth.emitters")
    for name in MODULES:
        if name.startswith(tuple(f"deferred_ir.{own}" for own in ("truth.path_tracer", *inner))):
            for other in (
                other.removeprefix("deferred_ir.") for other in imports(name) if other.startswith("deferred_ir.")
            ):
                assert other in shared or other in data or other.startswith(inner)
            for node in ast.walk(ast.parse(MODULES[name].read_text())):
                if isinstance(node, ast.ImportFrom) and (node.module or "").removeprefix("deferred_ir.") in data:
                    names = data[node.module.removeprefix("deferred_ir.")]
                    assert {alias.name for alias in node.names} <= names


def test_defaults_of_vpls_are_those_of_a_render():
    params, default = load_graph("deferred").nodes["vpl"].work.params, make_vpl_params({})
    assert asdict(default).items() <= asdict(params).items()
    assert make_vpl_params({"vpl.fov": 180}).fov == 180


def test_a_library_call_is_checked_too():
    for bad in ({"spp": 1, "vpls": 1}, {"spp": 0}, {"vpls": -1}, {"bounces": -1}, {"vpls": 1, "settings": {"fov": 1}}):
        with pytest.raises(SettingError):
            trace_reference(room(), (4, 4), **bad)
