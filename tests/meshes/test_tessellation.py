"""Maps of VPLs that draw a mesh without long edges: how it is split, and that straight edges suffice."""

from __future__ import annotations

import json
from dataclasses import replace
from importlib import import_module

import numpy as np
import pytest
import trimesh
from fixed_lights import lit_by, vpl_records
from hypothesis import given, settings
from hypothesis import strategies as st
from small_scenes import build, crooked_room, plane, room

from deferred_ir.base.errors import GraphError
from deferred_ir.engine.measurement import Measurement
from deferred_ir.meshes.subdivide import subdivide
from deferred_ir.report.run_json import describe_run

measurement = import_module("deferred_ir.profiling.studies.tessellation")
visibility = import_module("deferred_ir.profiling.checks.visibility")

PRE = {"shadow_maps.projection": "paraboloid", "shadow_maps.tessellation": "pre"}
COORDINATE = st.floats(-1.0, 1.0, width=32)
POINT = st.tuples(COORDINATE, COORDINATE, COORDINATE)


def edges(points, faces):
    """Return the lengths of all edges, (F, 3)."""
    corners = points[faces]
    return np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)


def areas(points, faces):
    """Return vector areas, (F, 3)."""
    a, b, c = (points[faces[:, i]] for i in range(3))
    return np.cross(b - a, c - a) / 2


def hull(seed):
    """A closed mesh: the convex hull of random points, stretched so that it has needles."""
    rng = np.random.default_rng(seed)
    mesh = trimesh.convex.convex_hull(rng.normal(size=(rng.integers(4, 30), 3)) * 10.0 ** rng.uniform(-2, 0, 3))
    return np.array(mesh.vertices, "f4").astype(float), np.array(mesh.faces)


# Without OpenGL


@settings(max_examples=200)
@given(corners=st.tuples(POINT, POINT, POINT), longest=st.floats(0.05, 4.0))
def test_the_parts_of_a_triangle_are_that_triangle(corners, longest):
    corners = np.array(corners)
    face = np.array([[0, 1, 2]])
    points, parts = subdivide(corners, face, longest)
    assert edges(points, parts).max() <= longest
    whole = areas(corners, face)[0]
    np.testing.assert_allclose(areas(points, parts).sum(axis=0), whole, atol=1e-12)
    area = np.linalg.norm(whole)
    if area < 1e-6:
        return
    # They lie in its plane, face its way, and reach nowhere beyond it, so with the same area they cannot overlap.
    assert np.linalg.norm(areas(points, parts), axis=1).sum() == pytest.approx(area, rel=1e-9)
    assert (areas(points, parts) @ whole > 0).all()
    barycentric = np.linalg.lstsq(np.vstack([corners.T, np.ones(3)]), np.vstack([points.T, np.ones(len(points))]))
    assert barycentric[0].min() > -1e-9
    np.testing.assert_allclose(corners.T @ barycentric[0], points.T, atol=1e-9)


@settings(max_examples=60)
@given(seed=st.integers(0, 10**6), share=st.floats(0.03, 1.0), shared=st.booleans())
def test_no_crack_opens_in_a_closed_mesh(seed, share, shared):
    """Each edge of a part is an edge of one other, which goes along it the other way."""
    positions, faces = hull(seed)
    given = (positions, faces) if shared else (positions[faces].reshape(-1, 3), np.arange(faces.size).reshape(-1, 3))
    points, parts = subdivide(*given, share * np.ptp(positions, axis=0).max())
    ways = np.concatenate([parts[:, [i, (i + 1) % 3]] for i in range(3)])
    assert len(np.unique(ways, axis=0)) == len(ways)
    assert set(map(tuple, ways)) == set(map(tuple, ways[:, ::-1]))
    assert len(np.unique(points, axis=0)) == len(points)


def test_short_edges_stay_and_vertices_at_one_place_become_one():
    positions = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [1, 0, 0], [0, 1, 0]], float)
    points, parts = subdivide(positions, np.array([[0, 1, 2], [3, 5, 4]]), 1.5)
    assert len(points) == 4
    np.testing.assert_array_equal(points[parts], positions[[[0, 1, 2], [3, 5, 4]]])


def test_a_neighbour_of_what_is_split_is_split_along_the_common_edge_alone():
    positions = np.array([[0, 0, 0], [2, 0, 0], [1, 0.8, 0], [1, -3, 0]])
    points, parts = subdivide(positions, np.array([[0, 1, 2], [1, 0, 3]]), 1.9)
    upper = points[parts][..., 1].min(axis=1) >= 0
    assert upper.sum() == 2
    assert (~upper).sum() > 2


@pytest.mark.parametrize("scale", [2.0**-20, 1.0, 2.0**20])
def test_the_unit_of_length_does_not_matter(scale):
    positions, faces = hull(3)
    points, parts = subdivide(positions, faces, 0.2)
    other_points, other = subdivide(scale * positions, faces, scale * 0.2)
    np.testing.assert_array_equal(other, parts)
    np.testing.assert_array_equal(other_points, scale * points)


def test_triangles_without_area_are_split_like_others():
    a, b = [0, 0, 0], [1, 0, 0]
    for corners in ([a, a, a], [a, b, b], [a, b, [0.5, 0, 0]], [a, b, [3, 0, 0]]):
        points, parts = subdivide(np.array(corners, float), np.array([[0, 1, 2]]), 0.25)
        assert edges(points, parts).max() <= 0.25
        assert len(parts) < 100


def test_nothing_is_left_of_nothing():
    points, parts = subdivide(np.zeros((0, 3)), np.zeros((0, 3), int), 1.0)
    assert len(points) == len(parts) == 0


@pytest.mark.parametrize("offset", [0.0, 1e3, 1e6])
def test_far_from_the_origin_it_ends(offset):
    """At 1e6, floats are a sixteenth apart."""
    positions = np.eye(3) + offset
    points, parts = subdivide(positions, np.array([[0, 1, 2]]), 0.01)
    assert edges(points, parts).max() <= 0.01
    assert len(parts) > 1000


@pytest.mark.parametrize("size", [1.0, 1e30])
def test_too_many_triangles_are_refused_before_they_are_made(size):
    with pytest.raises(GraphError, match=r"^shadow_maps\.edge: .* more than 1,000 triangles.*larger.*adaptive'$"):
        subdivide(size * np.eye(3), np.array([[0, 1, 2]]), 0.001, most=1000)


# On the device


def without_layers_from_vertex(one):
    one.gpu.layer_from_vertex = False


@pytest.mark.parametrize("prepare", [None, without_layers_from_vertex])
@pytest.mark.parametrize("edge", [0.05, 1.0])
def test_a_light_does_not_see_the_surface_it_is_on(renderer, tmp_path, edge, prepare):
    """Not even the triangle around it, whose straight edges would go across its map."""
    position = np.array([(0.2, 0.0, 0.1), (0.0, 0.0, 0.0), (-0.9, 0.0, 0.3)])
    records = vpl_records(position, [(0, 1, 0)] * 3, np.ones((3, 3)), fov=179.9)
    maps = {"shadow_maps.edge": edge, "shadow_maps.vpl_size": 64, "shadow_maps.spot_size": 64}
    one = lit_by(renderer, tmp_path, records, (32, 32), "deferred", set=PRE | maps)
    if prepare:
        prepare(one)
    one.render(build(plane()))
    with one.gpu.ctx:
        assert one.executor.resource(("shadow_maps", "atlas")).read()[1:].max() == 0


def mismatch(**settings):
    """Return the fraction of pairs of a pixel and a VPL about which maps and rays disagree."""
    small = {"shadow_maps.spot_size": 64, "vpl.count": 8, "vpl.fov": 179.9}
    options = visibility.Options((64, 64), 20_000, (512,), device="software", settings=small | settings)
    found = next(row for row in visibility.rows(crooked_room(), options) if row.lights == "vpls")
    return found.mismatch.value


def test_short_edges_drawn_straight_agree_with_rays_and_long_ones_do_not():
    adaptive = mismatch(**{"shadow_maps.projection": "paraboloid"})
    long, short = (mismatch(**PRE, **{"shadow_maps.edge": edge}) for edge in (1.0, 0.025))
    assert long > 3 * adaptive
    assert short < 1.1 * adaptive


def test_the_spotlight_draws_the_scene_itself(renderer):
    scene = room()
    scene = replace(scene, lights=(replace(scene.spotlight, fov=160.0),))
    images = [
        renderer((48, 48), set={**PRE, "shadow_maps.tessellation": choice}).render(scene, vpls=0).radiance
        for choice in ("pre", "adaptive")
    ]
    np.testing.assert_array_equal(*images)


@pytest.mark.parametrize("graph", ["deferred", "forward"])
@pytest.mark.parametrize("projection", ["perspective", "paraboloid"])
def test_the_mesh_is_told_of_where_there_is_one(renderer, graph, projection):
    scene, measurement = room(), Measurement()
    one = renderer((32, 32), graph, set=PRE | {"shadow_maps.projection": projection, "shadow_maps.edge": 0.1})
    plan = one.plan(scene, 8)
    one.draw(scene, one.plan(scene, 0))
    before = one.memory()["buffers"]
    one.draw(scene, plan, measurement=measurement)
    one.finish(measurement)
    told = describe_run(one, scene, graph, one.graph(8), plan, seed=0, measurement=measurement)["stand_in"]
    if projection == "perspective":
        assert told is None
        return
    points, parts = subdivide(scene.geometry.positions, scene.geometry.faces, 0.1 * scene.geometry.diagonal)
    assert told == {"triangles": len(parts), "bytes": 12 * len(points) + 12 * len(parts)}
    assert one.memory()["buffers"] >= before + told["bytes"]


# The measurement


def measured(kind, value, ms, mismatch):
    name = "edge" if kind == "pre" else "bend"
    figures = {"triangles": 1000, "bytes": 2048 if kind == "pre" else 0, "ms": ms, "mismatch": mismatch, "error": 0.0}
    return {"scene": "built", "tessellation": kind, name: value, **figures}


def test_beside_adaptive_stands_the_fastest_that_is_no_worse():
    rows = [measured("pre", 0.2, 10.0, 0.02), measured("pre", 0.1, 20.0, 0.0102), measured("pre", 0.05, 80.0, 0.01)]
    adaptive = [measured("adaptive", 4.0, 15.0, 0.01), measured("adaptive", 1.0, 30.0, 0.005)]
    assert measurement.equal([*rows, *adaptive]) == [(adaptive[0], rows[1]), (adaptive[1], None)]
    table = measurement.tables([*rows, *adaptive])
    assert "| built | pre, edge 0.1 | 1,000 | 2 KiB | 20 | 1.020 +-0.000 |" in table
    assert "| built | adaptive, bend 4 | 1,000 | 15 | pre, edge 0.1 | 1,000 | 20 |" in table
    assert "| built | adaptive, bend 1 | 1,000 | 30 | none |  |  |" in table


def test_the_measurement_writes_what_it_says(tmp_path, monkeypatch, capsys):
    small = {"SIZE": (32, 32), "VPLS": 8, "EDGES": (1.0, 0.1), "BENDS": (4.0,)}
    small["SETTINGS"] = {**measurement.SETTINGS, "vpl.count": 8}
    for name, value in small.items():
        monkeypatch.setattr(measurement, name, value)
    monkeypatch.setattr("sys.argv", ["tessellation", "cornell", "-o", str(tmp_path), "--turns", "1", "--pairs", "100"])
    measurement.main()
    assert {file.name for file in tmp_path.iterdir()} == {"tessellation.json", "tessellation.svg"}
    coarse, fine, adaptive = json.loads((tmp_path / "tessellation.json").read_text())["rows"]
    assert fine["triangles"] > 20 * coarse["triangles"]
    assert fine["bytes"] > 20 * coarse["bytes"] > 0
    assert adaptive["bytes"] == 0
    assert adaptive["triangles"] > coarse["triangles"]
    assert coarse["mismatch"] > fine["mismatch"]
    assert "cornell" in capsys.readouterr().out
