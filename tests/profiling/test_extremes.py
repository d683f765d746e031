"""Stiff and extreme cases, each of which went wrong once."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from fixed_lights import lit_by, vpl_records
from small_scenes import box, build, room

from deferred_ir.profiling.checks import cases
from deferred_ir.profiling.checks.changes import views
from deferred_ir.profiling.checks.extremes import Judge
from deferred_ir.profiling.light_scenes import SCENES
from deferred_ir.scene.lights.spotlight import Spotlight
from deferred_ir.scene.recentre import recentre_geometry
from deferred_ir.scene.scene import Scene
from deferred_ir.truth.reference import trace_reference


@pytest.mark.parametrize("graph", ["deferred", "hemisphere", "mapped", "accurate"])
def test_vpls_beside_an_edge_do_not_shine_through_the_other_wall(renderer, graph: str) -> None:
    """In a closed box a hundredth of the scene wide, where many lie within 0.0001 of it of another wall.

    Near planes cut that wall away, the rim of paraboloid maps had no neighbours, and rays ended short of it.
    """
    light = Spotlight((0.0, 0.0, 0.0), (0.3, -1.0, 0.2), 130.0, (1.0, 1.0, 1.0))
    walls = box((-1, -1, -1), (1, 1, 1))
    small = box((-0.015, -0.015, -0.015), (0.015, 0.015, 0.015))
    scene = build(walls, small, camera=room().camera, spotlight=light)
    maps = {} if graph == "accurate" else {"shadow_maps.vpl_size": 64}
    one = renderer((64, 64), graph, set={"vpl.count": 128, **maps})
    assert one.render(scene).radiance.max() == 0
    inside = replace(scene, camera=replace(scene.camera, position=(0.0, 0.0, 0.012), look_at=(0.0, 0.0, 0.0)))
    assert np.all(one.render(inside).radiance.max(axis=-1) > 0)


def test_paraboloid_maps_show_the_foot_of_a_wall_beside_a_vpl(renderer, tmp_path) -> None:
    """VPLs on the floor of a closed box, millionths of the scene from one or two of its walls.

    Up to the near plane, which at such a distance is an angle that counts, walls were cut away, and VPLs shone through.
    """
    half, diagonal = 0.015, 2 * 3**0.5
    scene = build(box((-1, -1, -1), (1, 1, 1)), box((-half,) * 3, (half,) * 3), camera=room().camera)
    away = np.array([3e-7, 1e-6, 3e-6, 1e-5]) * diagonal
    place = np.full((len(away), 3), 5e-7 * diagonal - half)
    place[:, 0] = away - half
    corners = np.concatenate([place, place])
    corners[: len(away), 2], corners[len(away) :, 2] = 0.3 * half, away - half
    vpls = vpl_records(corners, np.tile((0.0, 1.0, 0.0), (len(corners), 1)), np.ones((len(corners), 3)), fov=179.9)
    settings = {"shadow_maps.projection": "paraboloid", "shadow_maps.vpl_size": 64, "shadow_maps.spot_size": 64}
    one = lit_by(renderer, tmp_path, vpls, (64, 64), "deferred", set=settings, dark=True)
    assert one.render(scene).radiance.max() == 0


def test_paraboloid_maps_show_a_low_ceiling(renderer, tmp_path) -> None:
    """3000 times as wide as it is high above the VPL, all of its corners are at the map's rim, but it is no needle."""
    low = 3e-4
    scene = build(box((-1, -1, -1), (1, 1, 1)), box((-0.5, 0, -0.5), (0.5, low, 0.5)), camera=room().camera)
    vpls = vpl_records([(0.1, 2e-6, 0.2), (0.3, 2e-6, 0.1)], [(0, 1, 0)] * 2, np.ones((2, 3)), fov=179.9)
    settings = {"shadow_maps.projection": "paraboloid", "shadow_maps.vpl_size": 64, "shadow_maps.spot_size": 64}
    one = lit_by(renderer, tmp_path, vpls, (64, 64), "deferred", set=settings, dark=True)
    assert one.render(scene).radiance.max() == 0


@pytest.mark.parametrize("fov", [100.0, 170.0])
def test_a_spotlight_in_a_wall_shines(renderer, fov: float) -> None:
    """Roundings put the wall, askew, before the light or behind it."""
    turn = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))[0]
    walls = box((-1, -1, -1), (1, 1, 1))
    camera = replace(room().camera, position=tuple(turn @ (0.1, 0.2, 0.9)), look_at=tuple(turn @ (0.0, -0.3, -1.0)))
    one = renderer((32, 32), set={"vpl.count": 0, "shadow_maps.spot_size": 256})
    for place in np.random.default_rng(6).uniform(-0.9, 0.9, (6, 2)):
        at, below = turn @ (place[0], 1.0, place[1]), turn @ (place[0], -1.0, place[1])
        light = Spotlight(tuple(at), tuple(below), fov, (3.0, 2.0, 1.0))
        scene = build(replace(walls, positions=walls.positions @ turn.T), camera=camera, spotlight=light)
        found = one.render(scene).radiance
        wanted = trace_reference(scene, (32, 32), bounces=0).radiance
        assert np.abs(found - wanted).mean() < 0.02 * wanted.mean()


def giant(scene: Scene, times: float) -> Scene:
    """`scene` with a triangle so much larger, aslant, that cuts its far part off."""
    corners = [(-0.9, -1.0, -0.8), (1.0, -0.9, -0.7), (-0.05, 0.95, 0.75)]  # their middle is the origin
    plane = np.multiply(corners, times) - (0, 0, 0.6)
    g = scene.geometry
    return replace(
        scene,
        geometry=replace(
            g,
            positions=np.concatenate([g.positions, plane]),
            faces=np.concatenate([g.faces, [len(g.positions) + np.arange(3)]]).astype(np.int32),
            face_materials=np.append(g.face_materials, 0).astype(np.int32),
        ),
    )


@pytest.mark.parametrize("times", [1e3, 1e6])
def test_a_giant_triangle_spoils_nothing(renderer, times: float) -> None:
    """Near planes, offsets and roundings went by the diagonal. It is what a triangle of 8 scenes' width shows."""
    one = renderer((64, 64), set={"vpl.count": 8, "vpl.clamp": 0.0, "shadow_maps.vpl_size": 128})
    wanted = one.render(giant(room(), 8.0)).radiance
    found = one.render(giant(room(), times)).radiance
    assert np.abs(found - wanted).mean() < 2e-3 * wanted.mean()
    traced = trace_reference(giant(room(), times), (64, 64), vpls=8, settings={"vpl.clamp": 0.0}).radiance
    assert np.abs(traced - wanted).mean() < 0.03 * wanted.mean()


def test_a_giant_is_cut_up_where_the_scene_is() -> None:
    whole = giant(room(), 1e6).geometry
    parts = recentre_geometry(whole)
    assert recentre_geometry(parts) is parts
    assert len(whole.faces) < len(parts.faces) < 1000
    edges = np.diff(parts.positions[parts.faces], axis=1)
    near = np.abs(parts.positions[parts.faces]).max(axis=(1, 2)) < 10
    assert np.linalg.norm(edges[near], axis=2).max() <= 16 * parts.scale
    area = [
        np.linalg.norm(np.cross(*np.moveaxis(np.diff(g.positions[g.faces], axis=1), 1, 0)), axis=1).sum()
        for g in (whole, parts)
    ]
    assert area[1] == pytest.approx(area[0], rel=1e-12)


def test_the_scale_is_the_diagonal_unless_things_lie_far_out() -> None:
    scene = room()
    assert scene.geometry.scale == scene.geometry.diagonal
    assert recentre_geometry(scene.geometry) is scene.geometry
    assert giant(scene, 1e6).geometry.scale < 20 * scene.geometry.diagonal


def test_reflectance_beyond_half_floats_stays_finite(renderer) -> None:
    """A driver may store infinity, and times no light that is no number."""
    scene = room((1e6, 1e6, 1e6))
    found = renderer((32, 32), set={"vpl.count": 0, "shadow_maps.spot_size": 64}).render(scene).radiance
    assert np.isfinite(found).all()
    assert found.max() > 0


@pytest.mark.parametrize("factor", [1e-20, 1e20])
def test_exposure_makes_up_for_any_brightness(renderer, factor: float) -> None:
    scene = room()
    one = renderer((32, 32), set={"vpl.count": 4, "shadow_maps.vpl_size": 64})
    other = replace(
        scene, lights=(replace(scene.spotlight, emission=tuple(np.multiply(scene.spotlight.emission, factor))),)
    )
    plain, found = one.render(scene), one.render(other)
    np.testing.assert_allclose(found.radiance / factor, plain.radiance, rtol=1e-5, atol=1e-9)
    assert np.abs(found.display.astype(int) - plain.display).max() <= 1


@pytest.fixture(scope="module")
def judge():
    with Judge("software") as made:
        yield made


@pytest.mark.parametrize("case", cases.KINDS, ids=lambda case: case.name)
def test_lights_of_all_kinds_hold_at_their_extremes(judge, case) -> None:
    small = replace(case, size=(64, 64), vpls=16)
    (row,) = judge.rows(room(), [small])
    assert row.holds, row


@pytest.mark.parametrize("name", ["point", "directional", "rect", "grey sky", "panels"])
def test_scenes_of_any_light_are_checked(judge, name: str) -> None:
    """What is compared is right where it should be, and is not where a light is missing or wrong."""
    chosen = ("scale 100, E by its square", "1000 units from the origin", "E times 1e+20", "3 VPLs")
    scene = SCENES[name]()
    for row in judge.rows(scene, [replace(cases.NAMED[case], size=(64, 64)) for case in chosen]):
        assert row.holds
        assert not row.left_out
    wrong = replace(cases.NAMED["E times 1e+20"], gain=1.01e20, size=(64, 64))
    brighter = replace(wrong, against="rays", change=views.same, slack=0.0, bound=0.0)
    row, other = judge.rows(scene, [wrong, brighter])
    assert not row.holds
    assert other.figure is not None
    assert other.figure < 0.05


@pytest.mark.parametrize(("name", "why"), [("rect", "no light shines from a point"), ("point", "no light has a cone")])
def test_cases_that_a_scene_has_no_light_for_are_left_out(judge, name: str, why: str) -> None:
    (row,) = judge.rows(SCENES[name](), [cases.NAMED["spotlight's fov 179.9"]])
    assert (row.left_out, row.figure, row.note, row.holds) == (True, None, why, True)
    assert row.as_dict()["left_out"]
