"""Which VPLs each pixel sees, by exact shadow rays: bit masks that stand in for shadow maps.

With interleaved sampling a pixel asks only its share of the VPLs, and so few rays can cost less than a map of the whole
scene for each VPL. Pairs that bring nothing, since one of the two faces away, are never traced.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from contextlib import closing

import numpy as np

from deferred_ir.base.arrays import Array, Bools, Ints
from deferred_ir.base.parallel import in_order
from deferred_ir.graph.pass_base import Facts
from deferred_ir.rays.pixel_surfaces import Surfaces
from deferred_ir.rays.tracer import Tracer

PIXELS = 1 << 14
"""Pixels of a task: few enough for their arrays to stay in a core's cache, enough rays for one call of Embree."""

BITS = 32
"""VPLs in a word."""

THIN = 0.1
"""Part of all VPLs that a pixel asks beyond its share, on average: those missing beside edges; a guess, for costs."""

Share = tuple[Ints, slice]
"""Rows of surfaces, and the VPLs that light them."""


def cost_of_rays(facts: Facts) -> float:
    """Milliseconds that each VPL should take: 0.1 us of a core for a pixel in a room, 0.17 us in a cathedral."""
    return facts.pixels * (1 / facts.shares + THIN) * 1.5e-4 / (os.cpu_count() or 1)


def cost_of_maps(facts: Facts) -> float:
    """Milliseconds that a VPL's map should take: measured with OpenGL in software; a GPU takes a small part of it."""
    return (0.15 + 1.1e-4 * facts.triangles) * (1 if facts.software else 0.02)


def masks(
    tracer: Tracer, seen: Surfaces, vpls: np.ndarray, shares: Sequence[Share], threads: int | None = None
) -> tuple[Ints, int]:
    """Which VPLs (LIGHT records) of their share the surfaces `seen` (n) see, and how many rays that took.

    uint32 (words, n): bit b of word w stands for VPL 32 w + b of the share. It is 0 where one of the two faces away,
    the surface lies outside the VPL's cone, or something lies between them. The same for any number of threads.
    """
    most = max((lights.stop - lights.start for _, lights in shares), default=0)
    words = np.zeros((max(-(-most // BITS), 1), len(seen.pixel)), np.uint32)
    lifted = tracer.lift(vpls["position"].astype(np.float64), vpls["z_axis"]).astype(np.float32)
    tasks = [(rows[start : start + PIXELS], lights) for rows, lights in shares for start in range(0, len(rows), PIXELS)]

    def work(task: Share) -> tuple[Ints, int]:
        rows, lights = task
        return _look(tracer, seen, rows, vpls[lights], lifted[lights])

    rays = 0
    with closing(in_order(work, tasks, threads)) as results:
        for (rows, _), (part, traced) in zip(tasks, results, strict=True):
            words[: len(part), rows] = part
            rays += traced
    return words, rays


def _look(tracer: Tracer, seen: Surfaces, rows: Ints, vpls: np.ndarray, lifted: Array) -> tuple[Ints, int]:
    """Words (w, n) of the surfaces `rows` (n) for all of `vpls`, and the number of rays."""
    words = np.zeros((-(-len(vpls) // BITS), len(rows)), np.uint32)
    at, normal = seen.position[rows], seen.normal[rows]
    starts = tracer.lift(at, normal).astype(np.float32)
    position, face = np.ascontiguousarray(at.T), np.ascontiguousarray(normal.T)
    smooth = face if seen.shading_normal is seen.normal else np.ascontiguousarray(seen.shading_normal[rows].T)
    rays = 0
    for i, vpl in enumerate(vpls):
        asked = np.flatnonzero(_lit(vpl, position, face, smooth)) if vpl["emission"].any() else np.zeros(0, int)
        origins = starts[asked]
        free = asked[~tracer.occluded(origins, np.broadcast_to(lifted[i], origins.shape), lifted=True)]
        words[i // BITS, free] |= np.uint32(1 << i % BITS)
        rays += len(asked)
    return words, rays


def _lit(vpl: np.void, position: Array, normal: Array, shading_normal: Array) -> Bools:
    """Whether a VPL would light surfaces, (3, n) each, if nothing lay between: shaders/lib/lights/light.glsl, (n,)."""
    way = position - vpl["position"][:, None]
    leaving = _dot(vpl["z_axis"], way)
    edge = 1 - vpl["one_minus_cos"]
    lit: Bools = (leaving > 0) & (_dot(normal, way) < 0)
    lit &= leaving * leaving >= edge * edge * _dot(way, way)
    if shading_normal is not normal:
        lit &= _dot(shading_normal, way) < 0
    return lit


def _dot(a: Array, b: Array) -> Array:
    """Products of vectors whose coordinates are the first axis, added up."""
    total: Array = a[0] * b[0]
    total += a[1] * b[1]
    total += a[2] * b[2]
    return total
