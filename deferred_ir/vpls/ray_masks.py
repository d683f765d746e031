"""Find which VPLs each pixel sees by exact shadow rays: bit masks that replace shadow maps.

With interleaved sampling a pixel needs only its share of the VPLs, and so few rays can cost less than a map of the
whole scene for each VPL. No ray is traced where pixel or VPL faces away.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass, fields

import numpy as np

from deferred_ir.base.arrays import Array, Bools, Ints
from deferred_ir.base.parallel import run_in_order
from deferred_ir.rays.pixel_surfaces import Surfaces
from deferred_ir.rays.tracer import Tracer
from deferred_ir.scene.lights.base import end_outside
from deferred_ir.vpls.cast import Vpls
from deferred_ir.vpls.kernel import VplLimits, find_lit

PIXELS = 1 << 14
"""Pixels of a task: few enough for their arrays to stay in a core's cache, enough rays for one call of Embree."""

BITS = 32
"""VPLs in a word."""

Share = tuple[Ints, slice]
"""Rows of surfaces, and the slice of VPLs that light them."""


def trace_masks(
    tracer: Tracer,
    seen: Surfaces,
    vpls: Vpls,
    limits: VplLimits,
    shares: Sequence[Share],
    *,
    parallel: Bools | None = None,
    threads: int | None = None,
) -> tuple[Ints, int]:
    """Trace which VPLs of their share the surfaces `seen` (n) see. Returns the masks and the number of rays.

    Masks are uint32 (words, n): bit b of word w stands for VPL 32 w + b of the share. It is 0 where one of the two
    faces away, the surface lies outside the VPL's cone, or something lies between them. Positions and normals are taken
    in single precision, as shaders take them. parallel: which VPLs lie at infinity, from where they shine along their
    normals, bool (n,). The result does not depend on the number of `threads`.
    """
    most = max((chosen.stop - chosen.start for _, chosen in shares), default=0)
    words = np.zeros((max(-(-most // BITS), 1), len(seen.pixel)), np.uint32)
    lifted = tracer.lift(vpls.position.astype(np.float64), vpls.normal).astype(np.float32)
    candidates = _Candidates(
        vpls.position.astype(np.float32),
        vpls.normal.astype(np.float32),
        lifted,
        (vpls.emission != 0).any(axis=1),
        np.zeros(len(vpls), bool) if parallel is None else parallel,
    )
    tasks = [(rows[start : start + PIXELS], chosen) for rows, chosen in shares for start in range(0, len(rows), PIXELS)]

    def work(task: Share) -> tuple[Ints, int]:
        rows, chosen = task
        return _trace(tracer, seen, rows, candidates.part(chosen), limits.edge)

    rays = 0
    with closing(run_in_order(work, tasks, threads)) as results:
        for (rows, _), (part, traced) in zip(tasks, results, strict=True):
            words[: len(part), rows] = part
            rays += traced
    return words, rays


@dataclass(frozen=True, eq=False)
class _Candidates:
    """VPLs in single precision, (n, 3) each; `lifted` are their positions off their surfaces.

    shines, parallel: bool (n,), which have power, and which lie at infinity.
    """

    position: Array
    normal: Array
    lifted: Array
    shines: Bools
    parallel: Bools

    def part(self, chosen: slice) -> _Candidates:
        """Return some of them."""
        return _Candidates(*(getattr(self, field.name)[chosen] for field in fields(self)))


def _trace(tracer: Tracer, seen: Surfaces, rows: Ints, vpls: _Candidates, edge: np.float32) -> tuple[Ints, int]:
    """Return words (w, n) of the surfaces `rows` (n) for all of `vpls`, and the number of rays."""
    words = np.zeros((-(-len(vpls.shines) // BITS), len(rows)), np.uint32)
    at, normal = seen.position[rows], seen.normal[rows]
    starts = tracer.lift(at, normal).astype(np.float32)
    position, face = np.ascontiguousarray(at.T), np.ascontiguousarray(normal.T)
    smooth = face if seen.shading_normal is seen.normal else np.ascontiguousarray(seen.shading_normal[rows].T)
    rays = 0
    for i in np.flatnonzero(vpls.shines).tolist():
        way = position - vpls.position[i][:, None]
        if vpls.parallel[i]:
            way = np.broadcast_to(vpls.normal[i][:, None], way.shape)
        asked = np.flatnonzero(find_lit(way, vpls.normal[i], face, smooth, edge))
        origins = starts[asked]
        ends = np.broadcast_to(vpls.lifted[i], origins.shape)
        if vpls.parallel[i]:
            ends = end_outside(origins, -vpls.normal[i], tracer.scene.bounds)
        free = asked[~tracer.occluded(origins, ends, lifted=True)]
        words[i // BITS, free] |= np.uint32(1 << i % BITS)
        rays += len(asked)
    return words, rays
