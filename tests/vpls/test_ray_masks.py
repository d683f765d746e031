"""Bit masks of the VPLs that a pixel sees, compared with sums of VPLs by shadow rays."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from small_scenes import crooked_room, room, scaled, smooth_scene

from deferred_ir.rays.pixel_surfaces import Surfaces
from deferred_ir.rays.tracer import Tracer
from deferred_ir.truth.path_tracer import PathTracer
from deferred_ir.vpls.cast import NONE, cast
from deferred_ir.vpls.kernel import VplLimits
from deferred_ir.vpls.ray_masks import trace_masks
from deferred_ir.vpls.ray_sum import sum_radiance

SIZE = (40, 30)


def cast_into(scene, count=45, fov=179.9):
    """Return a tracer, the surfaces behind the pixels as `Surfaces` and as `Hits`, VPLs and their limits."""
    tracer = Tracer(scene)
    hits = PathTracer(scene, tracer).trace_camera_rays(SIZE)
    rows = np.flatnonzero(hits.hit)
    parts = (getattr(hits, name)[rows].astype(np.float32) for name in ("position", "normal", "shading_normal"))
    vpls = cast(scene.emitters, tracer, count, "sobol")
    limits = VplLimits.from_angle(fov, 0.02 * scene.geometry.diagonal)
    return tracer, Surfaces(rows, *parts), hits.rows(rows), vpls, limits


def unpack_bits(words, count):
    """Unpack uint32 (words, n) to bool (count, n)."""
    i = np.arange(count)
    return (words[i // 32] >> (i % 32)[:, None].astype(np.uint32)) & 1 == 1


def ask_all(seen, vpls):
    return [(np.arange(len(seen.pixel)), slice(0, len(vpls)))]


@pytest.mark.parametrize("scene", [room(), crooked_room(), smooth_scene()])
@pytest.mark.parametrize("fov", [179.9, 100.0])
def test_the_light_of_seen_vpls_is_that_of_the_reference(scene, fov):
    """A sum with masks against the sum with rays: not a pair may differ."""
    tracer, seen, hits, vpls, limits = cast_into(scene, fov=fov)
    words, _ = trace_masks(tracer, seen, vpls, limits, ask_all(seen, vpls))
    expected = sum_radiance(tracer, hits, vpls, limits)
    way = hits.position[None] - vpls.position[:, None]
    square = (way**2).sum(axis=-1)
    leaving = np.maximum((way * vpls.normal[:, None]).sum(axis=-1), 0)
    arriving = np.maximum(-(way * hits.shading_normal).sum(axis=-1), 0)
    kernel = leaving * arriving / (square * np.maximum(square, limits.clamp**2)) * unpack_bits(words, len(vpls))
    found = np.einsum("vp,vc->pc", kernel, vpls.emission) * hits.albedo / np.pi
    np.testing.assert_allclose(found, expected, rtol=1e-3, atol=1e-4 * expected.mean())


def test_no_ray_is_spent_on_pairs_that_face_away():
    tracer, seen, hits, vpls, limits = cast_into(room())
    words, rays = trace_masks(tracer, seen, vpls, limits, ask_all(seen, vpls))
    way = hits.position[None] - vpls.position[:, None]
    facing = ((way * vpls.normal[:, None]).sum(axis=-1) > 1e-5) & ((way * hits.normal).sum(axis=-1) < -1e-5)
    assert 0.99 * facing.sum() <= rays <= 1.01 * facing.sum()  # all but those at the very edge
    assert unpack_bits(words, len(vpls)).sum() < rays < 0.8 * facing.size


def test_vpls_without_power_are_never_asked():
    tracer, seen, _, vpls, limits = cast_into(room())
    whole, _ = trace_masks(tracer, seen, vpls, limits, ask_all(seen, vpls))
    emission = vpls.emission.copy()
    emission[1::2] = 0
    words, rays = trace_masks(tracer, seen, replace(vpls, emission=emission), limits, ask_all(seen, vpls))
    seen_ones = unpack_bits(words, len(vpls))
    assert not seen_ones[1::2].any()
    np.testing.assert_array_equal(seen_ones[::2], unpack_bits(whole, len(vpls))[::2])
    dark = replace(vpls, emission=np.zeros_like(emission))
    assert trace_masks(tracer, seen, dark, limits, ask_all(seen, vpls))[1] == 0 < rays


@pytest.mark.parametrize("n", [2, 4])
def test_each_share_is_asked_about_its_own_vpls(n):
    tracer, seen, _, vpls, limits = cast_into(room(), count=150)
    whole = unpack_bits(trace_masks(tracer, seen, vpls, limits, ask_all(seen, vpls))[0], len(vpls))
    share = seen.pixel // SIZE[0] % n * n + seen.pixel % n
    ends = np.arange(n * n + 1) * len(vpls) // (n * n)
    shares = [(np.flatnonzero(share == s), slice(int(ends[s]), int(ends[s + 1]))) for s in range(n * n)]
    words, _ = trace_masks(tracer, seen, vpls, limits, shares)
    assert words.shape == (-(-np.diff(ends).max() // 32), len(seen.pixel))
    for rows, lights in shares:
        np.testing.assert_array_equal(unpack_bits(words[:, rows], lights.stop - lights.start), whole[lights][:, rows])


@pytest.mark.parametrize("factor", [1e-3, 1e3])
def test_the_unit_of_length_does_not_matter(factor):
    pictures = []
    for scene in (crooked_room(), scaled(crooked_room(), factor)):
        tracer, seen, _, vpls, limits = cast_into(scene)
        pictures.append(unpack_bits(trace_masks(tracer, seen, vpls, limits, ask_all(seen, vpls))[0], len(vpls)))
    assert (pictures[0] == pictures[1]).mean() > 0.9995


def test_threads_do_not_matter():
    tracer, seen, _, vpls, limits = cast_into(room(), count=70)
    one, three = (trace_masks(tracer, seen, vpls, limits, ask_all(seen, vpls), threads=threads) for threads in (1, 3))
    np.testing.assert_array_equal(one[0], three[0])
    assert one[1] == three[1]


def test_nothing_to_ask():
    tracer, seen, _, vpls, limits = cast_into(room())
    words, rays = trace_masks(tracer, seen, NONE, limits, [(np.arange(len(seen.pixel)), slice(0, 0))])
    assert (words.shape, words.any(), rays) == ((1, len(seen.pixel)), False, 0)
    nobody = Surfaces(np.zeros(0, int), *[np.zeros((0, 3), np.float32)] * 3)
    assert trace_masks(tracer, nobody, vpls, limits, [(np.zeros(0, int), slice(0, len(vpls)))])[1] == 0
