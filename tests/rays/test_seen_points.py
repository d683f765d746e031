"""`find_seen` compared with one ray at a time."""

import numpy as np
import pytest
from small_scenes import crooked_room

from deferred_ir.rays.pixel_surfaces import Surfaces
from deferred_ir.rays.seen_points import PointsToSee, find_seen
from deferred_ir.rays.tracer import Tracer
from deferred_ir.truth.path_tracer import PathTracer

NOBODY = 0xFFFFFFFF


def points(places):
    return PointsToSee(places, np.zeros_like(places), np.zeros(len(places), bool))


@pytest.mark.parametrize("threads", [1, 3])
@pytest.mark.parametrize("rays", [1, 3, 8])
def test_bits_are_the_answers_of_single_rays(rays, threads):
    scene = crooked_room()
    tracer = Tracer(scene)
    hits = PathTracer(scene, tracer).trace_camera_rays((120, 90))
    rows = np.flatnonzero(hits.hit)
    at = Surfaces(rows, *(getattr(hits, n)[rows].astype(np.float32) for n in ("position", "normal", "shading_normal")))
    rng = np.random.default_rng(rays)
    places = rng.uniform(-0.8, 0.8, (50, 3)).astype(np.float32)
    chosen = rng.integers(0, 50, (len(rows), rays)).astype(np.uint32)
    chosen[rng.random(chosen.shape) < 0.2] = NOBODY
    bits, count = find_seen(tracer, at, points(places), chosen, NOBODY, threads=threads)
    assert count == (chosen != NOBODY).sum()
    starts = tracer.lift(at.position, at.normal)
    for k in range(rays):
        asked = chosen[:, k] != NOBODY
        seen = ~tracer.occluded(starts[asked], places[chosen[asked, k]], lifted=True)
        assert 0.1 < seen.mean() < 0.99
        assert ((bits >> k & 1 == 1)[asked] == seen).all()
        assert not (bits >> k & 1)[~asked].any()


def test_nobody_asks_nothing():
    tracer = Tracer(crooked_room())
    at = Surfaces(np.zeros(0, int), *np.zeros((3, 0, 3), np.float32))
    bits, count = find_seen(tracer, at, points(np.zeros((1, 3), np.float32)), np.zeros((0, 4), np.uint32), NOBODY)
    assert (len(bits), count) == (0, 0)


def test_points_at_infinity_are_seen_along_their_normals():
    scene = crooked_room()
    tracer = Tracer(scene)
    hits = PathTracer(scene, tracer).trace_camera_rays((40, 30))
    rows = np.flatnonzero(hits.hit)
    at = Surfaces(rows, *(getattr(hits, n)[rows].astype(np.float32) for n in ("position", "normal", "shading_normal")))
    down = np.array([[0.3, -1.0, 0.2], [0.0, 0.0, 0.0]], np.float32) / np.float32(np.sqrt(1.13))
    both = PointsToSee(np.array([[9e9, 0, 0], [0.1, 0.2, 0.1]], np.float32), down, np.array([True, False]))
    bits, _ = find_seen(tracer, at, both, np.tile(np.array([0, 1], np.uint32), (len(rows), 1)), NOBODY)
    starts = tracer.lift(at.position, at.normal)
    sky = ~tracer.occluded(starts, starts - 50 * down[0])
    point = ~tracer.occluded(starts, np.broadcast_to(both.places[1], starts.shape), lifted=True)
    assert ((bits & 1 == 1) == sky).all()
    assert ((bits >> 1 & 1 == 1) == point).all()
