"""Interleaved sampling: how VPLs are dealt, the image against `deferred`, and the filter against its definition."""

from __future__ import annotations

import numpy as np
import pytest
from distance import assert_same_but_for_edges, rel_mse
from fixed_lights import lit_by, vpl_records
from hypothesis import given
from hypothesis import strategies as st
from small_scenes import Mesh, box, build, crooked_room, plane, quad, room, sphere

from deferred_ir.base.errors import GraphError
from deferred_ir.frame.frame import NEAR
from deferred_ir.loading.load import load
from deferred_ir.rays.pixel_surfaces import decode_gbuffer
from deferred_ir.rays.tracer import Tracer
from deferred_ir.scene.camera import Camera
from deferred_ir.vpls.interleaving import deal, find_share_starts, find_sub_buffers, sort_lonely_list

ANGLE = np.radians(25)
ABOVE = Camera((0.0, 3.0, 0.001), (0.0, 0.0, 0.0), fov=30.0)


@given(count=st.integers(0, 5000), more=st.integers(0, 100), n=st.sampled_from([1, 2, 4, 8]))
def test_every_vpl_is_dealt_once_and_shares_are_even(count, more, n):
    slots = np.random.default_rng(count).permutation(count + more)[:count]
    starts = find_share_starts(count, n)
    assert sorted(deal(slots, count + more)) == list(range(count))
    assert (starts[0], starts[-1]) == (0, count)
    assert len(starts) == n * n + 1
    assert np.ptp(np.diff(starts)) <= 1


def test_the_order_is_fixed_and_has_no_structure():
    order = deal(np.arange(1024), 1024)
    assert (order == deal(np.arange(1024), 1024)).all()
    assert abs(np.corrcoef(order, np.arange(1024))[0, 1]) < 0.1


def test_vpls_that_stay_keep_their_order_and_nearly_all_their_shares():
    """If VPLs were dealt by number, removing one would change the share of every other."""
    slots, starts = np.arange(256), find_share_starts(255, 4)
    before = deal(slots, 256)
    for gone in (0, 100, 255):
        left = np.delete(slots, gone)
        after = left[deal(left, 256)]
        assert (after == before[before != gone]).all()
        share = dict(zip(before.tolist(), np.repeat(np.arange(16), np.diff(find_share_starts(256, 4))), strict=True))
        now = np.repeat(np.arange(16), np.diff(starts))
        moved = sum(share[slot] != new for slot, new in zip(after.tolist(), now, strict=True))
        assert moved <= 15


@given(size=st.tuples(st.integers(1, 70), st.integers(1, 70)), n=st.sampled_from([1, 2, 4, 8]))
def test_sub_buffers_hold_every_pixel_once(size, n):
    filled = np.zeros(size[::-1], int)
    for share, (x, y, width, height) in enumerate(find_sub_buffers(size, n)):
        filled[y : y + height, x : x + width] += 1
        assert width == len(range(share % n, size[0], n))
        assert height == len(range(share // n, size[1], n))
    assert (filled == 1).all()


def render_both(make, scene, vpls, size, **settings):
    """Return radiance by `deferred` and by `interleaved` with these settings, and the second Renderer."""
    full = make(size, "deferred").render(scene, vpls=vpls, seed=1).radiance
    one = make(size, "interleaved", set={name.replace("__", "."): value for name, value in settings.items()})
    return full, one.render(scene, vpls=vpls, seed=1).radiance, one


def read_port(one, port):
    with one.gpu.ctx:
        return one.executor.resource(tuple(port.split("."))).read()


def test_with_blocks_of_one_pixel_it_is_the_deferred_image(renderer):
    full, shared, one = render_both(renderer, room(), 24, (40, 32), interleave__n=1)
    assert (full == shared).all()
    assert "every pixel is lit by all VPLs" in one.plan(room(), 24).left_out["interleave"]


@pytest.mark.parametrize("n", [3, 5, 6, 7])
def test_other_blocks_are_refused(renderer, n):
    with pytest.raises(GraphError, match=f"interleave: n {n}: wants 1, 2, 4 or 8"):
        renderer((8, 8), "interleaved", set={"interleave.n": n}).plan(room())


@pytest.mark.parametrize("n", [2, 4, 8])
@pytest.mark.parametrize("size", [(61, 47), (32, 32), (7, 3), (1, 1)])
def test_the_filter_is_what_it_says(renderer, n, size):
    scene = crooked_room()
    one = renderer(size, "interleaved", set={"interleave.n": n}, keep_all=True)
    one.render(scene, vpls=70, seed=1)
    irradiance = read_port(one, "gather.irradiance")[..., :3]
    depth, normals = read_port(one, "gbuffer.depth")[..., 0], read_port(one, "gbuffer.normals")
    shares = read_port(one, "light_shares.shares")[..., :3]
    expected, lonely = gather_by_definition(scene, n, 0.5, shares, (depth, normals))
    count = read_port(one, "neighbours.lonely_count").item()
    listed = sort_lonely_list(read_port(one, "neighbours.lonely_pixels"))[:count]
    assert sorted(listed[:, 0]) == np.flatnonzero(lonely).tolist()
    np.testing.assert_allclose(irradiance[~lonely], expected[~lonely], rtol=2e-5, atol=1e-6)


def gather_by_definition(scene, n, fewest, shares, gbuffer):
    """Filter by the definition. Returns irradiance (H, W, 3) and where too few neighbours count (H, W)."""
    depth, normals = gbuffer
    height, width = depth.shape
    position, normal, shading = np.zeros((3, height, width, 3))
    seen = decode_gbuffer(scene.camera, NEAR * scene.geometry.diagonal, depth, normals)
    for image, values in ((position, seen.position), (normal, seen.normal), (shading, seen.shading_normal)):
        image.reshape(-1, 3)[seen.pixel] = values
    rectangles = find_sub_buffers((width, height), n)
    result, lonely = np.zeros((height, width, 3)), np.zeros((height, width), bool)

    def neighbour(x, y, i, j):
        if not (0 <= i < width and 0 <= j < height and depth[j, i] > 0):
            return None
        off = position[j, i] - position[y, x]
        alike = shading[y, x] @ shading[j, i] >= np.cos(ANGLE)
        flat = abs(normal[y, x] @ off) <= np.sin(ANGLE / 2) * np.linalg.norm(off)
        left, low, _, _ = rectangles[j % n * n + i % n]
        return shares[low + j // n, left + i // n] if alike and flat else None

    def moved(to, centre):
        return to + n if to < centre else to - n

    for y, x in np.argwhere(depth > 0):
        left = min(max(x - n // 2 + 1, 0), max(width - n, 0))  # the seed is 1
        low = min(max(y - n // 2, 0), max(height - n, 0))
        window = [(i, j) for j in range(low, low + n) for i in range(left, left + n)]
        found = [neighbour(x, y, i, j) for i, j in window]
        if sum(value is not None for value in found) <= fewest * n * n:  # one at least is missing
            lonely[y, x] = True
            continue
        for k, (i, j) in enumerate(window):
            for to in ((moved(i, x), j), (i, moved(j, y)), (moved(i, x), moved(j, y))):
                found[k] = neighbour(x, y, *to) if found[k] is None else found[k]
        result[y, x] = np.mean([value for value in found if value is not None], axis=0)
    return result, lonely


@pytest.mark.parametrize("vpls", [3, 100])
@pytest.mark.parametrize("n", [2, 4, 8])
def test_constant_irradiance_is_kept_to_rounding(renderer, tmp_path, n, vpls):
    scene = build(plane(), camera=ABOVE)
    away = np.random.default_rng(3).normal(size=(vpls, 3)) * (1, 0, 1) + (0, 2, 0)
    away *= 1e5 / np.linalg.norm(away, axis=1, keepdims=True)
    records = vpl_records(away, -away, np.full((vpls, 3), 1e9))
    size = (45, 38)
    full = lit_by(renderer, tmp_path, records, size, "deferred", dark=True).render(scene).radiance
    one = lit_by(renderer, tmp_path, records, size, "interleaved", set={"interleave.n": n}, dark=True)
    shared = one.render(scene).radiance
    assert full.min() > 0
    np.testing.assert_allclose(shared, full, rtol=1e-4)


def test_vpls_several_half_widths_away_from_a_plane(renderer, tmp_path):
    scene = build(plane(), camera=ABOVE)
    away = np.random.default_rng(4).normal(size=(256, 3)) * (2, 0, 2) + (0, 3, 0)
    records = vpl_records(away, (0, -1, 0) + 0 * away, 1 + 0 * away)
    full, shared = (
        lit_by(renderer, tmp_path, records, (128, 128), graph, dark=True).render(scene).radiance
        for graph in ("deferred", "interleaved")
    )
    assert full.min() > 0
    ratio = shared / full
    assert np.sqrt(((ratio - 1) ** 2).mean()) < 5e-3
    assert shared.mean() == pytest.approx(full.mean(), rel=1e-3)


TOWARDS_Z = Camera((0.3, 0.2, 4.0), (0.0, 0.0, 0.0), fov=40.0)
EDGES = {
    # The VPLs above the box lie behind the plane of its front.
    "a fold": (
        build(box((-0.5, -0.5, -0.5), (0.5, 0.5, 0.5)), camera=Camera((0.2, 1.6, 1.9), (0, 0, 0), fov=45.0)),
        ((0, 2, 0), (0, -1, 0)),
    ),
    # Two walls that face the camera; the VPLs between them shine away from it, upon the one behind.
    "a step": (
        build(
            quad((-2, -2, -1), (2, -2, -1), (2, 2, -1)),
            quad((-1, -1, 1.5), (1, -1, 1.5), (1, 0, 1.5)),
            camera=TOWARDS_Z,
        ),
        ((0, 0.5, 0.8), (0, 0, -1)),
    ),
}


@pytest.mark.parametrize("name", EDGES)
@pytest.mark.parametrize("n", [2, 4, 8])
def test_no_light_crosses_an_edge(renderer, tmp_path, name, n):
    scene, (at, towards) = EDGES[name]
    at = at + np.random.default_rng(1).uniform(-0.02, 0.02, (64, 3))
    lights = vpl_records(at, np.broadcast_to(towards, at.shape), np.ones((64, 3)))
    full, shared = (
        lit_by(renderer, tmp_path, lights, (96, 80), graph, **options, dark=True).render(scene).radiance
        for graph, options in (("deferred", {}), ("interleaved", {"set": {"interleave.n": n}}))
    )
    dark = full.max(axis=-1) == 0
    assert 0.1 < dark.mean() < 0.9
    assert shared[dark].max() == 0
    assert (shared[~dark].max(axis=-1) > 0).all()


@pytest.mark.parametrize("n", [2, 4, 8])
@pytest.mark.parametrize("vpls", [0, 1, 3, 15])
def test_fewer_vpls_than_pixels_of_a_block(renderer, n, vpls):
    full, shared, _ = render_both(renderer, room(), vpls, (64, 48), interleave__n=n)
    assert np.isfinite(shared).all()
    assert shared.mean() == pytest.approx(full.mean(), rel=0.15)  # edges are as wide as blocks in so small an image


def test_more_vpls_in_a_share_than_in_a_block_of_the_buffer(renderer):
    """Such a share takes several draws, whose results are added."""
    settings = {"shadow_maps.vpl_size": 16, "interleave.n": 2}
    full, shared = (
        renderer((48, 40), graph, set=chosen).render(room(), vpls=1000).radiance
        for graph, chosen in (("deferred", {"shadow_maps.vpl_size": 16}), ("interleaved", settings))
    )
    everywhere = np.ones(full.shape[:2], bool)
    assert rel_mse(shared, full, everywhere) < 0.02
    assert shared.mean() == pytest.approx(full.mean(), rel=1e-2)


def test_it_goes_without_shadow_maps(renderer, tmp_path):
    """The filter's uploads for its list must not disturb the textures that it reads."""
    readers, images = {"deferred": ("lighting",), "interleaved": ("lighting", "gather", "light_shares")}, []
    for name, passes in readers.items():
        wires = [f"[passes.{reader}.inputs]\nshadows = false" for reader in passes]
        text = [f'extends = "{name}"', "[passes]", "shadow_maps = false", *wires]
        text[3] += "\nviews = false\nblockers = false"
        (tmp_path / f"{name}.toml").write_text("\n".join(text))
        images.append(renderer((64, 48), tmp_path / f"{name}.toml").render(crooked_room(), vpls=64).radiance)
    full, shared = images
    assert rel_mse(shared, full, np.ones(full.shape[:2], bool), trim=1e-3) < 0.01
    assert shared.mean() == pytest.approx(full.mean(), rel=1e-2)


def make_leaves(count):
    """Return so many small triangles in all directions that nearly every pixel has an edge beside it."""
    rng = np.random.default_rng(2)
    centre = rng.uniform(-1, 1, (count, 1, 3))
    corners = centre + rng.normal(size=(count, 3, 3)) * 0.04
    return Mesh(corners.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3), (0.3, 0.6, 0.2))


def test_foliage_has_no_holes(renderer):
    scene = build(plane(2.0, -1.0), make_leaves(6000), camera=Camera((0.0, 1.0, 3.5), (0.0, 0.0, 0.0), fov=45.0))
    full, shared, one = render_both(renderer, scene, 64, (96, 80))
    hit = read_port(one, "gbuffer.depth")[::-1, :, 0] > 0
    assert read_port(one, "neighbours.lonely_count").item() > 0.2 * hit.sum()
    lit = full.max(axis=-1) > 0.1 * full[hit].mean()
    assert (shared[lit].max(axis=-1) > 0).mean() > 0.995
    assert rel_mse(shared, full, hit, trim=1e-3) < 0.05
    assert shared[hit].mean() == pytest.approx(full[hit].mean(), rel=1e-2)
    assert shared[~hit].max() == 0


@pytest.mark.parametrize("n", [2, 4, 8])
def test_where_no_neighbour_counts_it_is_the_deferred_image(renderer, n):
    """Pixels ask for all shares but, at most, their own, in several blocks of the buffer."""
    settings = {"neighbours__angle": 0.0, "neighbours__fewest": 1.0, "interleave__n": n}
    full, shared, one = render_both(renderer, crooked_room(), 300, (64, 48), **settings)
    assert read_port(one, "neighbours.lonely_count").item() == 64 * 48
    assert_same_but_for_edges(shared, full)


def test_the_more_pixels_ask_the_missing_vpls_the_less_the_error(renderer):
    scene, errors, asked = load("atrium"), [], []
    for fewest in (0.0, 0.5, 1.0):
        full, shared, one = render_both(renderer, scene, 64, (96, 96), neighbours__fewest=fewest)
        errors.append(rel_mse(shared, full, full.max(axis=-1) > 0, trim=1e-3))
        asked.append(read_port(one, "neighbours.lonely_count").item())
    assert asked == sorted(asked)
    assert errors[2] < 0.7 * errors[1] < 0.5 * errors[0]


@pytest.mark.parametrize(("name", "bound"), [("cornell", 0.01), ("colors", 0.01), ("atrium", 0.03)])
def test_it_adds_little_error_on_built_in_scenes(renderer, name, bound):
    scene, size = load(name), (128, 128)
    full, shared, _ = render_both(renderer, scene, 64, size)
    rays = scene.camera.rays(size).reshape(-1, 3)
    hit = Tracer(scene).closest(np.broadcast_to(scene.camera.position, rays.shape), rays).hit.reshape(size)
    assert rel_mse(shared, full, hit, trim=1e-3) < bound
    assert shared[hit].mean() == pytest.approx(full[hit].mean(), rel=3e-3)


def test_a_surface_with_smooth_normals_is_no_edge(renderer):
    _, _, one = render_both(renderer, build(sphere(), camera=Camera((0, 0, 3), (0, 0, 0), fov=45.0)), 16, (96, 96))
    depth = read_port(one, "gbuffer.depth")[..., 0]
    assert read_port(one, "neighbours.lonely_count").item() < 0.1 * (depth > 0).sum()
