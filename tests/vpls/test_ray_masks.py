"""Bit masks of which VPLs a pixel sees, pair by pair against the ray tracer, and in sum against the VPL reference."""

from __future__ import annotations

import numpy as np
import pytest
from fixed_lights import vpl_records
from small_scenes import crooked_room, room, scaled, smooth_scene

from deferred_ir.rays.pixel_surfaces import Surfaces
from deferred_ir.rays.tracer import Tracer
from deferred_ir.truth.path_tracer import PathTracer
from deferred_ir.vpls import ray_sum
from deferred_ir.vpls.cast import cast
from deferred_ir.vpls.ray_masks import masks

SIZE = (40, 30)


def lit_scene(scene, count=45, fov=179.9):
    """A tracer, what the pixels see as `Surfaces` and `Hits`, the VPLs and their records."""
    tracer = Tracer(scene)
    hits = PathTracer(scene, tracer).seen(SIZE)
    rows = np.flatnonzero(hits.hit)
    parts = (getattr(hits, name)[rows].astype(np.float32) for name in ("position", "normal", "shading_normal"))
    vpls = cast(scene.spotlight, tracer, count, "sobol")
    clamp = 0.02 * scene.geometry.diagonal
    records = vpl_records(vpls.position, vpls.normal, vpls.emission, fov=fov, clamp=clamp)
    return tracer, Surfaces(rows, *parts), hits.rows(rows), vpls, records


def bits(words, count):
    """Bool (count, n) of uint32 (words, n)."""
    i = np.arange(count)
    return (words[i // 32] >> (i % 32)[:, None].astype(np.uint32)) & 1 == 1


def everything(seen, vpls):
    return [(np.arange(len(seen.pixel)), slice(0, len(vpls)))]


@pytest.mark.parametrize("scene", [room(), crooked_room(), smooth_scene()])
@pytest.mark.parametrize("fov", [179.9, 100.0])
def test_the_light_of_seen_vpls_is_that_of_the_reference(scene, fov):
    """Weights of the reference's own, with the masks instead of its rays: not a pair may differ."""
    tracer, seen, hits, vpls, records = lit_scene(scene, fov=fov)
    words, _ = masks(tracer, seen, records, everything(seen, vpls))
    expected = ray_sum.indirect(tracer, hits, vpls, fov=fov, clamp=0.02)
    way = hits.position[None] - vpls.position[:, None]
    square = (way**2).sum(axis=-1)
    leaving = np.maximum((way * vpls.normal[:, None]).sum(axis=-1), 0)
    arriving = np.maximum(-(way * hits.shading_normal).sum(axis=-1), 0)
    c = 0.02 * scene.geometry.diagonal
    kernel = leaving * arriving / (square * np.maximum(square, c**2)) * bits(words, len(vpls))
    found = np.einsum("vp,vc->pc", kernel, vpls.emission) * hits.albedo / np.pi
    np.testing.assert_allclose(found, expected, rtol=1e-3, atol=1e-4 * expected.mean())


def test_no_ray_is_spent_on_pairs_that_face_away():
    tracer, seen, hits, vpls, records = lit_scene(room())
    words, rays = masks(tracer, seen, records, everything(seen, vpls))
    way = hits.position[None] - vpls.position[:, None]
    facing = ((way * vpls.normal[:, None]).sum(axis=-1) > 1e-5) & ((way * hits.normal).sum(axis=-1) < -1e-5)
    assert 0.99 * facing.sum() <= rays <= 1.01 * facing.sum()  # all but those at the very edge
    assert bits(words, len(vpls)).sum() < rays < 0.8 * facing.size


def test_vpls_without_power_are_never_asked():
    tracer, seen, _, vpls, records = lit_scene(room())
    records["emission"][1::2] = 0
    whole, _ = masks(
        tracer, seen, vpl_records(vpls.position, vpls.normal, vpls.emission, fov=179.9), everything(seen, vpls)
    )
    words, rays = masks(tracer, seen, records, everything(seen, vpls))
    seen_ones = bits(words, len(vpls))
    assert not seen_ones[1::2].any()
    np.testing.assert_array_equal(seen_ones[::2], bits(whole, len(vpls))[::2])
    records["emission"] = 0
    assert masks(tracer, seen, records, everything(seen, vpls))[1] == 0 < rays


@pytest.mark.parametrize("n", [2, 4])
def test_each_share_is_asked_about_its_own_vpls(n):
    tracer, seen, _, vpls, records = lit_scene(room(), count=150)
    whole = bits(masks(tracer, seen, records, everything(seen, vpls))[0], len(vpls))
    share = seen.pixel // SIZE[0] % n * n + seen.pixel % n
    ends = np.arange(n * n + 1) * len(vpls) // (n * n)
    shares = [(np.flatnonzero(share == s), slice(int(ends[s]), int(ends[s + 1]))) for s in range(n * n)]
    words, _ = masks(tracer, seen, records, shares)
    assert words.shape == (-(-np.diff(ends).max() // 32), len(seen.pixel))
    for rows, lights in shares:
        np.testing.assert_array_equal(bits(words[:, rows], lights.stop - lights.start), whole[lights][:, rows])


@pytest.mark.parametrize("factor", [1e-3, 1e3])
def test_the_unit_of_length_does_not_matter(factor):
    pictures = []
    for scene in (crooked_room(), scaled(crooked_room(), factor)):
        tracer, seen, _, vpls, records = lit_scene(scene)
        pictures.append(bits(masks(tracer, seen, records, everything(seen, vpls))[0], len(vpls)))
    assert (pictures[0] == pictures[1]).mean() > 0.9995


def test_threads_do_not_matter():
    tracer, seen, _, vpls, records = lit_scene(room(), count=70)
    one, three = (masks(tracer, seen, records, everything(seen, vpls), threads=threads) for threads in (1, 3))
    np.testing.assert_array_equal(one[0], three[0])
    assert one[1] == three[1]


def test_nothing_to_ask():
    tracer, seen, _, _, records = lit_scene(room())
    words, rays = masks(tracer, seen, records[:0], [(np.arange(len(seen.pixel)), slice(0, 0))])
    assert (words.shape, words.any(), rays) == ((1, len(seen.pixel)), False, 0)
    nobody = Surfaces(np.zeros(0, int), *[np.zeros((0, 3), np.float32)] * 3)
    assert masks(tracer, nobody, records, [(np.zeros(0, int), slice(0, len(records)))])[1] == 0
