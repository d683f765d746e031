"""Soft shadows of a spotlight with a radius, held against rays to its disc."""

from __future__ import annotations

from dataclasses import replace
from importlib import import_module

import numpy as np
import pytest
from distance import rel_mse
from small_scenes import build, plane, quad, room, scaled

from deferred_ir.scene.camera import Camera
from deferred_ir.scene.lights.spotlight import Spotlight

soft_shadows = import_module("deferred_ir.profiling.studies.soft_shadows")

GRAPHS = ("deferred", "forward")
SIZE = (96, 96)
RADIUS = soft_shadows.RADIUS


def with_radius(scene, radius):
    return replace(scene, lights=(replace(scene.spotlight, radius=radius),))


def sized(scene, factor):
    """`scaled`, the radius as well."""
    return with_radius(scaled(scene, factor), scene.spotlight.radius * factor)


def drawn(make, scene, graph="deferred", size=SIZE, **settings):
    return make(size, graph, set=settings).render(scene, vpls=0).radiance


@pytest.mark.parametrize("fov", [100.0, 160.0])
@pytest.mark.parametrize("factor", [0.001, 1.0, 1000.0])
def test_the_penumbra_is_right_where_a_hard_shadow_is_wrong(renderer, fov, factor):
    """Contact and a wide penumbra; wider than 140 degrees the map is a paraboloid."""
    scene = sized(soft_shadows.scene(fov=fov), factor)
    direct, share = soft_shadows.truth(scene, SIZE, 64)
    penumbra = (share > 0.02) & (share < 0.98)
    assert penumbra.sum() > 300
    soft, hard = (drawn(renderer, scene, **{"shadow_maps.soft": value}) for value in ("pcss", "off"))
    assert rel_mse(soft, direct, penumbra) < 0.1 * rel_mse(hard, direct, penumbra)
    assert rel_mse(soft, direct, direct[..., 0] > 0) < 0.1 * rel_mse(hard, direct, direct[..., 0] > 0)


@pytest.mark.parametrize("height", [0.02, 0.1, 0.4, 0.7])
@pytest.mark.parametrize("radius", [0.02, 0.15, 0.5])
def test_a_penumbra_is_as_wide_as_the_edge_is_high(renderer, height, radius):
    """Of a straight edge, from a tenth of the disc to nine tenths: 0.687 of its diameter, by similar triangles."""
    scene = soft_shadows.edge(height, radius, fov=130.0)
    found = soft_shadows.width(soft_shadows.visibility(scene, device="software"), height, radius)
    texel = 2 * np.tan(np.radians(65)) / 2048
    # The hardware's comparison adds a texel.
    assert found == pytest.approx(0.687 * 2 * radius * height / (1 - height), rel=0.06, abs=1.5 * texel)


@pytest.mark.parametrize("graph", GRAPHS)
def test_without_a_radius_nothing_changes(renderer, graph):
    soft, hard = (drawn(renderer, room(), graph, **{"shadow_maps.soft": value}) for value in ("pcss", "off"))
    assert np.array_equal(soft, hard)


@pytest.mark.parametrize("graph", GRAPHS)
def test_hard_shadows_of_a_disc_are_those_of_a_point(renderer, graph):
    disc = with_radius(room(), 0.2)
    assert np.array_equal(drawn(renderer, disc, graph, **{"shadow_maps.soft": "off"}), drawn(renderer, room(), graph))
    assert not np.array_equal(drawn(renderer, disc, graph), drawn(renderer, room(), graph))


@pytest.mark.parametrize("graph", GRAPHS)
def test_a_vanishing_disc_is_a_point(renderer, graph):
    one, other = (drawn(renderer, with_radius(room(), radius), graph) for radius in (1e-30, 0.0))
    assert rel_mse(one, other, other[..., 0] > 0) < 1e-6


@pytest.mark.parametrize("fov", [60.0, 130.0, 170.0])
@pytest.mark.parametrize("radius", [0.01, 0.3, 3.0])
@pytest.mark.parametrize("tilt", [0.0, 40.0, 75.0])
def test_with_nothing_between_a_plane_is_lit_all_over(renderer, fov, radius, tilt):
    """Radii up to three times the distance: then the face's own plane goes through the disc."""
    up = np.array([0.0, np.cos(np.radians(tilt)), np.sin(np.radians(tilt))])
    along = np.cross(up, (1.0, 0.0, 0.0))
    across = np.array([1.0, 0.0, 0.0])
    floor = build(
        quad(*(3 * np.array([-across - along, across - along, across + along]))),
        camera=Camera((0.1, 2.0, 0.9), (0.0, 0.0, 0.0), fov=70.0),
        spotlight=Spotlight((0.2, 1.0, 0.3), (0.0, 0.0, 0.0), fov, (1.0, 1.0, 1.0)),
    )
    soft, hard = (drawn(renderer, with_radius(floor, each)) for each in (radius, 0.0))
    assert hard.max() > 0
    assert np.array_equal(soft, hard)


@pytest.mark.parametrize("graph", GRAPHS)
def test_a_blocker_that_lies_on_the_receiver_has_a_hard_shadow(renderer, graph):
    """A thin slab on the floor: next to it it is as dark as with a point, and a little away it is not."""
    slab = quad((-0.3, 1e-3, 0.3), (0.3, 1e-3, 0.3), (0.3, 1e-3, -0.3))
    light = Spotlight((0.0, 1.5, 0.0), (0.0, 0.0, 0.0), 70.0, (3.0, 3.0, 3.0))
    scene = build(plane(), slab, camera=Camera((0.0, 1.2, 1.2), (0.0, 0.0, 0.0), fov=50.0), spotlight=light)
    soft, hard = (drawn(renderer, with_radius(scene, radius), graph) for radius in (0.2, 0.0))
    assert (np.abs(soft - hard) > 0.01 * hard.max()).mean() < 0.01


@pytest.mark.parametrize("graph", GRAPHS)
@pytest.mark.parametrize("radius", [0.9, 10.0, 1e6])
@pytest.mark.parametrize("fov", [90.0, 175.0])
def test_a_radius_beyond_the_distance_gives_numbers_between_dark_and_light(renderer, graph, radius, fov):
    scene = replace(room(), lights=(replace(room().spotlight, fov=fov),))
    image = drawn(renderer, with_radius(scene, radius), graph)
    free = drawn(renderer, scene, graph, **{"shadow_maps.spot_offset": 16.0, "shadow_maps.spot_size": 16})
    assert np.isfinite(image).all()
    assert image.min() >= 0
    assert image.max() <= 1.001 * max(free.max(), drawn(renderer, scene, graph).max())


@pytest.mark.parametrize("graph", GRAPHS)
def test_a_light_on_a_surface_and_maps_of_the_smallest_size_give_finite_numbers(renderer, graph):
    down = Spotlight((0.0, -1.0, 0.0), (0.0, -2.0, 0.0), 120.0, (1.0, 1.0, 1.0), 0.3)
    for scene in (with_radius(room(), 0.3), replace(room(), lights=(down,))):
        assert np.isfinite(drawn(renderer, scene, graph, **{"shadow_maps.spot_size": 16})).all()


def test_a_graph_without_the_second_wire_has_hard_shadows(renderer, tmp_path):
    (tmp_path / "hard.toml").write_text('extends = "deferred"\n[passes.lighting]\ninputs = { blockers = false }\n')
    disc = with_radius(room(), 0.2)
    assert np.array_equal(drawn(renderer, disc, tmp_path / "hard.toml"), drawn(renderer, room()))


def test_more_taps_are_closer_to_the_truth(renderer):
    scene = soft_shadows.scene()
    direct, share = soft_shadows.truth(scene, SIZE, 64)
    penumbra = (share > 0.02) & (share < 0.98)
    errors = [
        rel_mse(drawn(renderer, scene, **{"shadow_maps.soft_taps": taps}), direct, penumbra) for taps in (2, 8, 64)
    ]
    assert errors == sorted(errors, reverse=True)


def test_the_measure_writes_figures_plot_and_picture(tmp_path, monkeypatch, capsys):
    for name, value in (("HEIGHTS", (0.3,)), ("SIZE", (32, 32)), ("STRIP", (64, 1)), ("SPP", 4)):
        monkeypatch.setattr(soft_shadows, name, value)
    monkeypatch.setattr("sys.argv", ["soft_shadows", "-o", str(tmp_path)])
    soft_shadows.main()
    told = capsys.readouterr().out
    assert told.count("| 0.3 |") == 1
    assert "| soft |" in told
    files = {"soft-shadows.json", "soft-shadows.svg", "soft-shadows-pictures.svg"}
    assert {path.name for path in tmp_path.iterdir()} == files
