"""Shadow maps against rays: the pairs that are drawn, what is counted of them, and scenes where the answer is known."""

from __future__ import annotations

from dataclasses import replace
from importlib import import_module

import numpy as np
import pytest
from small_scenes import build, plane, quad, room, scaled

from deferred_ir.base.errors import GraphError
from deferred_ir.frame.vpl_buffer import VPLS_PER_BLOCK
from deferred_ir.graph.params import specs
from deferred_ir.profiling.light_scenes import SCENES
from deferred_ir.scene.camera import Camera
from deferred_ir.scene.lights.spotlight import Spotlight
from deferred_ir.scene.scene import Scene

visibility = import_module("deferred_ir.profiling.checks.visibility")

SIZE = (64, 64)
LIGHT = Spotlight((0.0, 1.9, 0.0), (0.0, 0.0, 0.0), 60.0, (3.0, 2.0, 1.0))
EDGE = 0.3
HEIGHT = 1.0
"""Half an edge of the square over the floor, and how high it hangs."""


def ceiling():
    return quad((-1, 2, -1), (1, 2, -1), (1, 2, 1))


def between() -> Scene:
    """A floor and a ceiling: VPLs on the floor light all of the ceiling."""
    return build(plane(), ceiling(), camera=Camera((0.1, 1.0, 3.0), (0.0, 1.0, 0.0), fov=70.0), spotlight=LIGHT)


def blocked(height: float = HEIGHT) -> Scene:
    """A floor with a square that hangs over it and throws a square shadow."""
    blocker = quad((-EDGE, height, EDGE), (EDGE, height, EDGE), (EDGE, height, -EDGE))
    return build(plane(2.0), blocker, camera=Camera((0.1, 0.6, 2.4), (0.0, 0.0, 0.0)), spotlight=LIGHT)


def options(*, pairs=1000, sizes=(64,), size=SIZE, seed=0, **settings):
    small = {"shadow_maps.spot_size": 256, "vpl.count": 16}
    return visibility.Options(size, pairs, sizes, seed, "software", small | settings)


def rows(scene, **given):
    return {row.lights: row for row in visibility.rows(scene, options(**given)) if row.projection == "perspective"}


@pytest.fixture
def frame(renderer):
    """The pairs of one frame, and the Renderer that drew it."""

    def draw(scene, lights="vpls", size=SIZE, seed=0, **settings):
        given = {"shadow_maps.spot_size": 256, "shadow_maps.vpl_size": 64} | settings
        one = renderer(size, visibility.GRAPH, set=given, passes=visibility.PASSES)
        plan = one.plan(scene, outputs=[visibility.name_output(lights)])
        one.draw(scene, plan, seed=seed)
        return visibility.trace_pairs(one, scene, lights), one

    return draw


def records(one):
    return one.executor.resource(("vpl", "vpls")).records


# Which pairs


def test_pairs_face_each_other_and_lie_in_the_cone(frame):
    pairs, one = frame(room(), **{"vpl.fov": 100.0})
    lights = records(one)[pairs.light]
    to = pairs.position - lights["position"]
    distance = np.linalg.norm(to, axis=1)
    assert len(pairs.light) > 500
    assert ((pairs.normal * to).sum(axis=1) < 0).all()
    assert ((lights["z_axis"] * to).sum(axis=1) >= 0.999 * np.cos(np.radians(50)) * distance).all()
    assert (pairs.irradiance > 0).all()


def test_pixels_lie_on_surfaces_and_their_normals_are_those_of_the_faces(frame):
    pairs, one = frame(room())
    walls = np.abs(pairs.position).max(axis=1) > 0.999
    assert np.abs(np.abs(pairs.position[walls]).max(axis=1) - 1).max() < 0.5 * one.tracer().offset
    wall = np.abs(pairs.position[walls]).argmax(axis=1)
    facing = -np.sign(pairs.position[walls, wall])
    np.testing.assert_allclose(pairs.normal[walls, wall], facing, atol=1e-3)


def test_every_vpl_gets_its_share_of_pixels(frame):
    """VPLs of two blocks of the buffer; all are on the floor and see all of the ceiling, as does the camera."""
    scene = replace(between(), camera=Camera((0.0, 0.05, 0.0), (0.0, 2.0, 0.2), fov=80.0))
    pairs, one = frame(scene, **{"vpl.count": 256, "vpl.fov": 179.0})
    alive = len(records(one))
    assert alive > VPLS_PER_BLOCK
    counts = np.bincount(pairs.light, minlength=alive)
    mean = len(pairs.light) / alive
    assert mean > 4
    assert counts.std() < 1.3 * np.sqrt(mean)  # as drawn at random
    assert counts[VPLS_PER_BLOCK:].mean() == pytest.approx(mean, rel=0.2)


def test_another_seed_draws_other_pairs(frame):
    first, other = (frame(room(), seed=seed, **{"vpl.pattern": "halton"})[0] for seed in (0, 1))
    assert first.light[:200].tolist() != other.light[:200].tolist()
    again = frame(room(), seed=0, **{"vpl.pattern": "halton"})[0]
    assert again.light.tolist() == first.light.tolist()


def test_the_maps_answer_is_that_of_lighting(frame, renderer):
    """Direct light of a grey floor is irradiance times visibility, over pi."""
    pairs, one = frame(blocked(), "spotlight")
    picture = renderer(SIZE, set={"shadow_maps.spot_size": 256, "vpl.count": 0}).render(blocked()).radiance
    with one.gpu.ctx:
        counts = one.executor.resource(("spotlight_pairs", "pairs")).read()[::-1][..., 2] > 0
    luminance = picture[counts] @ [0.2126, 0.7152, 0.0722]
    np.testing.assert_allclose(luminance, 0.5 * pairs.irradiance * pairs.shown / np.pi, rtol=2e-3, atol=1e-6)
    assert picture[~counts].max() == 0


def test_the_camera_turns_by_a_number_of_pixels():
    camera = Camera((1.0, 2.0, 3.0), (-0.5, 0.3, -4.0), fov=70.0)
    turned = visibility._turn(camera, (80, 40), np.array([0.5, -0.5]))
    ray = camera.rays((80, 40))[20, 40]  # the pixel to the right of the middle and below
    np.testing.assert_allclose(turned.axes[2], ray / np.linalg.norm(ray), atol=1e-12)


# Scenes where the answer is known


def test_rays_know_the_shadow_of_a_square(frame):
    pairs, _ = frame(blocked(), "spotlight", size=(128, 128))
    floor = pairs.position[:, 1] < 0.01
    # Where the way to the light crosses the height of the square.
    t = HEIGHT / LIGHT.position[1]
    crossing = np.abs(pairs.position[floor][:, [0, 2]] * (1 - t)).max(axis=1)
    clear = np.abs(crossing - EDGE) > 1e-3
    np.testing.assert_array_equal(pairs.lit[floor][clear], crossing[clear] > EDGE)
    assert 0.02 < (~pairs.lit[floor]).mean() < 0.98


def test_a_good_map_errs_at_the_edge_of_the_shadow_only(frame):
    pairs, _ = frame(blocked(), "spotlight", size=(128, 128))
    wrong = (pairs.shown >= 0.5) != pairs.lit
    assert 0 < wrong.mean() < 0.03
    crossing = np.abs(pairs.position * (1 - HEIGHT / LIGHT.position[1]))[:, [0, 2]].max(axis=1)
    distance = LIGHT.position[1] - HEIGHT
    texel = 2 * distance * np.tan(np.radians(LIGHT.fov) / 2) / 256
    assert np.abs(crossing[wrong] - EDGE).max() < 3 * texel


def test_with_nothing_in_between_map_and_ray_agree():
    for row in rows(between(), pairs=20_000).values():
        assert row.pairs >= 20_000
        assert row.mismatch == row.leaks == row.false_shadows == visibility.Fraction(0.0, 0.0)


def test_coarse_maps_have_false_shadows_and_leaks():
    row = rows(room(), sizes=(16,), pairs=4000)["vpls"]
    assert row.false_shadows.value > 0.01
    assert row.leaks.value > 0.001
    assert row.light_lost.value > 0.01


def test_with_a_huge_offset_light_leaks():
    """16 texels on the floor are 0.14, above the square: its whole shadow is gone."""
    low = replace(blocked(0.05), camera=Camera((0.0, 0.04, 0.35), (0.0, 0.0, 0.0)))
    usual, huge = (rows(low, **{"spotlight_pairs.spot_offset": offset})["spotlight"] for offset in (1.0, 16.0))
    assert usual.leaks.value < 0.03
    assert huge.leaks.value > 0.5
    assert huge.light_leaked.value > 0.5
    assert huge.false_shadows.value < 0.01


def test_larger_maps_err_less():
    small, large = (rows(room(), sizes=(size,), pairs=4000)["vpls"] for size in (32, 256))
    assert large.mismatch.value < 0.5 * small.mismatch.value


@pytest.mark.parametrize("factor", [1e-3, 1e3])
def test_the_unit_of_length_does_not_matter(factor):
    one, other = (rows(scene, pairs=4000)["vpls"] for scene in (room(), scaled(room(), factor)))
    assert other.pairs == pytest.approx(one.pairs, rel=0.01)
    assert other.mismatch.value == pytest.approx(one.mismatch.value, abs=0.002)
    assert other.light_wrong.value == pytest.approx(one.light_wrong.value, abs=0.002)


# What is made of them


def pairs_of(shown, lit, irradiance):
    n = len(shown)
    nothing = np.zeros((n, 3))
    return visibility.Pairs(
        np.zeros(n, int), nothing, nothing, np.array(shown), np.array(lit), np.array(irradiance, float)
    )


def test_leaks_and_false_shadows_are_distinguished_and_weighted():
    pairs = pairs_of([1.0, 0.75, 0.5, 0.25, 0.0], [True, False, True, True, False], [1, 2, 4, 8, 16])
    assert pairs.sums().tolist() == [5, 1, 1, 31, 0.75 * 2, 0.5 * 4 + 0.75 * 8]


def test_a_share_has_the_spread_of_its_frames():
    """Frames of one size: the standard error of a mean. Of any sizes: none where all have the same share."""
    parts = np.array([3.0, 5.0, 4.0, 8.0])
    fraction = visibility._divide(parts, np.full(4, 100.0))
    assert fraction.value == pytest.approx(0.05)
    assert fraction.error == pytest.approx(np.std(parts / 100, ddof=1) / 2)
    sizes = np.array([10.0, 40.0, 30.0])
    assert visibility._divide(0.1 * sizes, sizes).error == pytest.approx(0, abs=1e-12)
    assert visibility._divide(np.zeros(3), np.zeros(3)) == visibility.Fraction(None, None)


def test_standard_errors_are_the_spread_of_other_seeds():
    found = [rows(room(), sizes=(32,), pairs=4000, seed=seed)["vpls"].mismatch for seed in range(6)]
    spread = np.std([each.value for each in found], ddof=1)
    told = np.mean([each.error for each in found])
    assert 0.3 < spread / told < 3


def test_rows_are_those_of_the_parameters():
    scene, sizes = room(), (16, 32)
    found = list(visibility.rows(scene, options(sizes=sizes)))
    params = type(visibility.load_graph("deferred").nodes["shadow_maps"].work.params)
    spec = specs(params).get("projection")
    projections = spec.choices if spec else ("perspective",)
    vpls = [(row.projection, row.map_size) for row in found if row.lights == "vpls"]
    assert vpls == [(projection, size) for projection in projections for size in sizes]
    assert {row.map_size for row in found if row.lights == "spotlight"} == {256}
    assert all(row.scene == scene.name and row.pairs >= 1000 and "llvmpipe" in row.device for row in found)


def test_without_vpls_there_is_the_spotlight_alone():
    assert list(rows(room(), sizes=(16, 32), **{"vpl.count": 0})) == ["spotlight"]


def test_without_light_there_is_nothing():
    scene = room()
    assert rows(replace(scene, lights=(replace(scene.spotlight, emission=(0.0, 0.0, 0.0)),))) == {}


def test_where_no_pixel_faces_a_light_there_are_no_figures():
    scene = replace(room(), camera=Camera((0.0, 5.0, 0.0), (0.0, 9.0, 0.0), up=(1.0, 0.0, 0.0)))
    row = rows(scene)["vpls"]
    assert row.pairs == 0
    assert row.mismatch == visibility.Fraction(None, None)
    assert row.frames == visibility.LEAST_FRAMES


def test_faults_show_before_the_first_row():
    with pytest.raises(GraphError, match=r"shadow_maps.vpl_size: is 3, but wants a whole number"):
        next(visibility.rows(room(), options(sizes=(64, 3))))
    with pytest.raises(GraphError, match=r"64 VPLs of 4096x4096 need"):
        next(visibility.rows(room(), options(sizes=(64, 4096), **{"vpl.count": 64})))


def test_each_kind_of_direct_light_has_a_row():
    """Maps and rays mean the same light: few pairs differ, all at borders of shadows."""
    found = {row.lights: row for row in visibility.rows(SCENES["mixture"](), options(pairs=8000))}
    projections = {kind: row.projection for kind, row in found.items() if kind != "vpls"}
    perspective = dict.fromkeys(("spotlight", "point", "spot"), "perspective")
    assert projections == {**perspective, "directional": "orthographic"}
    assert {kind: found[kind].map_size for kind in projections} == {
        kind: 128 if kind == "point" else 256 for kind in projections
    }
    for row in found.values():
        assert row.pairs > 1000
        assert row.mismatch.value < 0.05


def test_pairs_with_points_at_infinity_are_traced_there():
    (row, *_) = visibility.rows(SCENES["grey sky"](), options(pairs=4000, sizes=(256,)))
    assert row.lights == "vpls"
    assert row.mismatch.value < 0.05
