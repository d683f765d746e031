"""Culling clusters of triangles leaves maps the same to the last bit as if every light drew every triangle."""

from __future__ import annotations

import numpy as np
import pytest
from fixed_lights import lit_by, vpl_records
from hypothesis import given, settings
from hypothesis import strategies as st
from small_scenes import Mesh, build, crooked_room, room, triangle_soup

from deferred_ir.frame.vpl_buffer import VPL, VPLS_PER_BLOCK
from deferred_ir.loading.load import load
from deferred_ir.meshes.clusters import Clusters
from deferred_ir.meshes.posed import MapMesh
from deferred_ir.shadows import mesh_choice

SETTINGS = {"shadow_maps.spot_size": 128, "shadow_maps.vpl_size": 32}
WHOLE = 10**9


def lights_among(mesh: Mesh, seed: int, count: int = 8, fov: float = 150.0) -> np.ndarray:
    """Make lights on corners, on faces and between them that look along axes, within planes and anywhere."""
    rng = np.random.default_rng(seed)
    faces = mesh.positions[mesh.faces]
    low, high = faces.min(axis=(0, 1)), faces.max(axis=(0, 1))
    position = rng.uniform(low, high, (count, 3))
    position[0::3] = faces[rng.integers(len(faces), size=len(position[0::3])), 0]
    position[1::3] = faces[rng.integers(len(faces), size=len(position[1::3]))].mean(axis=1)
    normal = rng.normal(size=(count, 3))
    normal[::2] = np.round(normal[::2])
    normal[(normal == 0).all(axis=1)] = (0, 0, 1)
    return vpl_records(position, normal, np.ones((count, 3)), fov=fov)


# Without OpenGL


@pytest.mark.parametrize("count", [1, 7, 8, 9, 16, 17, 100, 300])
def test_each_triangle_is_in_one_cluster(count):
    mesh = triangle_soup(1, count)
    clusters = Clusters(mesh.positions, mesh.faces, most=8)
    assert sorted(clusters.order) == list(range(count))
    assert clusters.starts[0] == 0
    assert clusters.starts[-1] == count
    assert (clusters.sizes >= 1).all()
    assert (clusters.sizes <= 8).all()


@pytest.mark.parametrize("count", [8, 17, 100])
def test_clusters_of_triangles_of_one_size_are_full_but_for_the_last(count):
    corners = np.random.default_rng(0).uniform(-1, 1, (count, 1, 3)) + np.eye(3)
    clusters = Clusters(corners.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3), most=8)
    assert len(clusters) == -(-count // 8)
    assert (clusters.sizes == 8).sum() == count // 8


def test_a_cluster_holds_triangles_of_like_size():
    """Otherwise the small neighbours of a large triangle would count as bent in maps in which they are flat."""
    mesh = triangle_soup(2, 400)
    corners = mesh.positions[mesh.faces]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    clusters = Clusters(mesh.positions, mesh.faces, most=8)
    for start, end in zip(clusters.starts[:-1], clusters.starts[1:], strict=True):
        part = longest[clusters.order[start:end]]
        assert part.max() <= 2 * part.min() * (1 + 1e-6) or part.max() < 2**-9 * longest.max()


def test_clusters_are_neighbours():
    """Points of a grid: each cluster fills a compact block of it."""
    grid = np.stack(np.meshgrid(*[np.arange(16.0)] * 3), axis=-1).reshape(-1, 3)
    mesh = Mesh((grid[:, None] + np.zeros((3, 1))).reshape(-1, 3), np.arange(3 * len(grid)).reshape(-1, 3))
    clusters = Clusters(mesh.positions, mesh.faces, most=64)
    for start, end in zip(clusters.starts[:-1], clusters.starts[1:], strict=True):
        assert np.ptp(grid[clusters.order[start:end]], axis=0).max() <= 3


def clip_distances(light: np.ndarray, positions: np.ndarray, hemisphere: bool) -> np.ndarray:
    """As shaders/shadow_maps/planar.vert computes them, in its precision; the light's plane first."""
    d = positions.astype(np.float32) - light["position"]
    x, y, z = (
        d[..., 0] * axis[0] + d[..., 1] * axis[1] + d[..., 2] * axis[2]
        for axis in (light["x_axis"], light["y_axis"], light["z_axis"])
    )
    return np.stack([z] if hemisphere else [z, z + x, z - x, z + y, z - y])


@settings(max_examples=200)
@given(
    seed=st.integers(0, 10**6),
    fov=st.sampled_from([1.0, 20.0, 90.0, 150.0, 179.9]),
    scale=st.sampled_from([1e-6, 1e-3, 1.0, 1e3, 1e6]),
    offset=st.sampled_from([0.0, 1.0, 1e4]),
    hemisphere=st.booleans(),
)
@pytest.mark.slow
def test_what_is_left_out_lies_behind_one_plane_for_the_shader_too(seed, fov, scale, offset, hemisphere):
    mesh = triangle_soup(seed, 64, scale, offset * scale)
    clusters = Clusters(mesh.positions, mesh.faces, most=4)
    lights = lights_among(mesh, seed, fov=fov)
    visible = clusters.find_visible(lights, hemisphere=hemisphere)
    for light, row in zip(lights, visible, strict=True):
        for cluster in np.flatnonzero(~row):
            faces = mesh.faces[clusters.order[clusters.starts[cluster] : clusters.starts[cluster + 1]]]
            distances = clip_distances(light, mesh.positions[faces], hemisphere)
            assert (distances < 0).all(axis=(1, 2)).any()


@pytest.mark.parametrize("hemisphere", [False, True])
def test_what_a_light_cannot_see_is_left_out(hemisphere):
    """Small triangles all around a light: half of them lie in front of it, fewer in a pyramid of 90 degrees."""
    rng = np.random.default_rng(2)
    centre = rng.normal(size=(4000, 1, 3))
    corners = centre / np.linalg.norm(centre, axis=-1, keepdims=True) + 1e-3 * rng.normal(size=(4000, 3, 3))
    clusters = Clusters(corners.reshape(-1, 3), np.arange(12000).reshape(-1, 3), most=8)
    light = vpl_records(np.zeros((1, 3)), [(0.3, 0.5, -0.2)], np.ones((1, 3)), fov=90.0)
    share = clusters.find_visible(light, hemisphere=hemisphere)[0] @ clusters.sizes / 4000
    seen = 1 / 2 if hemisphere else 1 / 6
    assert seen <= share < seen + 0.1


def test_no_lights_see_no_clusters():
    mesh = triangle_soup(1)
    clusters = Clusters(mesh.positions, mesh.faces, most=8)
    assert clusters.find_visible(np.zeros(0, VPL)).shape == (0, len(clusters))


# On the device


class Atlases:
    """Draws the same lights with clusters of a chosen size; WHOLE: every light draws all triangles."""

    def __init__(self, make, folder, monkeypatch, count: int, settings=SETTINGS) -> None:
        self.records = np.zeros(count, VPL)
        self.one = lit_by(make, folder, self.records, (32, 32), "deferred", set=settings)
        self.patch = monkeypatch

    def __call__(self, scene, most: int) -> np.ndarray:
        self.patch.setattr(MapMesh, "make_clusters", lambda mesh: Clusters(mesh.positions, mesh.faces, most))
        self.one._forget()
        self.one.render(scene)
        with self.one.gpu.ctx:
            return self.one.executor.resource(("shadow_maps", "atlas")).read()


@pytest.fixture
def atlases(renderer, tmp_path, monkeypatch):
    return lambda count, **options: Atlases(renderer, tmp_path, monkeypatch, count, **options)


@pytest.mark.parametrize("layer_from_vertex", [True, False])
def test_any_scene_has_the_same_maps(atlases, layer_from_vertex):
    draw = atlases(8)
    if not layer_from_vertex:
        draw.one.gpu.layer_from_vertex = False

    @settings(max_examples=20)
    @given(
        seed=st.integers(0, 10**6),
        fov=st.sampled_from([30.0, 90.0, 150.0, 175.0]),
        scale=st.sampled_from([1e-3, 1.0, 1e3]),
        most=st.sampled_from([1, 8, 64]),
    )
    def same(seed, fov, scale, most):
        mesh = triangle_soup(seed, scale=scale)
        scene = build(mesh)
        draw.records[:] = lights_among(mesh, seed, fov=fov)
        np.testing.assert_array_equal(draw(scene, most), draw(scene, WHOLE))

    same()


def test_the_atrium_has_the_same_maps(atlases):
    scene = load("atrium")
    draw = atlases(16)
    rng = np.random.default_rng(5)
    faces = rng.integers(len(scene.geometry.faces), size=16)
    position = scene.geometry.positions[scene.geometry.faces[faces, 0]]
    draw.records[:] = vpl_records(position, scene.geometry.face_normals[faces], np.ones((16, 3)))
    full = draw(scene, WHOLE)
    np.testing.assert_array_equal(draw(scene, 256), full)
    assert (full > 0).mean() > 0.05


def test_lights_of_every_block_have_the_same_maps(atlases):
    count = VPLS_PER_BLOCK + 9
    draw = atlases(count, settings={"shadow_maps.spot_size": 128, "shadow_maps.vpl_size": 16})
    mesh = triangle_soup(8, 64)
    scene = build(mesh)
    draw.records[:] = lights_among(mesh, 8, count)
    np.testing.assert_array_equal(draw(scene, 8), draw(scene, WHOLE))


def test_a_light_that_sees_nothing_leaves_its_map_clear(atlases):
    """All lights look out of the room from its corners; nothing is drawn at all."""
    draw = atlases(3)
    away = np.array([[2.0, 2.0, 2.0]]).repeat(3, axis=0)
    draw.records[:] = vpl_records(away, away, np.ones((3, 3)), fov=60.0)
    assert draw(room(), 4)[1:].max() == 0
    draw.records["z_axis"] *= -1
    assert draw(room(), 4)[1:].max() > 0


def test_memory_counts_clusters_once_they_are_made(renderer):
    one = renderer((32, 32))
    one.render(room(), vpls=0)
    with_clusters = one._buffers.buffer_bytes
    assert with_clusters == sum(b.size for b in one._buffers._buffers) + one._buffers.cluster_buffers.nbytes
    assert one._buffers.cluster_buffers.nbytes >= 24 * 3 * 4


# Stand-ins


def halved(scene):
    """Only every other triangle, with vertices of its own."""
    geometry = scene.geometry
    corners = geometry.positions[geometry.faces[::2]]
    return MapMesh(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3))


@pytest.mark.parametrize("graph", ["deferred", "forward"])
@pytest.mark.parametrize("projection", ["perspective", "paraboloid"])
def test_maps_of_vpls_alone_draw_a_stand_in(renderer, monkeypatch, graph, projection):
    """Without every other triangle shadows are missing; the spotlight's stay, so direct light is the same."""
    scene, makes = crooked_room(), []

    def other(frame, params):
        def make():
            makes.append(params)
            return halved(scene)

        return [frame.buffers.stand_in("halved", make)]

    one = renderer((48, 48), graph, set={"shadow_maps.projection": projection})
    whole, direct = (one.render(scene, vpls=vpls).radiance for vpls in (16, 0))
    before = one._buffers.buffer_bytes
    monkeypatch.setattr(mesh_choice, "choose_meshes", other)
    half = [one.render(scene, vpls=16).radiance for _ in range(2)]
    assert half[0].mean() > 1.002 * whole.mean()
    np.testing.assert_array_equal(*half)
    np.testing.assert_array_equal(one.render(scene, vpls=0).radiance, direct)
    assert len(makes) == 1
    mesh = one._buffers.stand_in("halved", lambda: halved(scene))
    assert one._buffers.buffer_bytes == before + mesh.nbytes + 12 * 3 * 3 * 4
    one._forget()
    one.render(scene, vpls=16)
    assert len(makes) == 2
