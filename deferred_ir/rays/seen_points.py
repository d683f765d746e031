"""Find by shadow rays which of a few points each surface sees, in few passes over arrays that fit a core's cache."""

from __future__ import annotations

from contextlib import closing
from dataclasses import dataclass

import numpy as np

from deferred_ir.base.arrays import Array, Bools, Ints
from deferred_ir.base.parallel import run_in_order
from deferred_ir.rays.pixel_surfaces import Surfaces
from deferred_ir.rays.tracer import Tracer

SURFACES = 1 << 13
"""Surfaces of a task."""


@dataclass(frozen=True, eq=False)
class PointsToSee:
    """m points or directions. places: float32 (m, 3), points in world units, lifted off their surfaces (`Tracer.lift`).

    normals: float32 (m, 3). parallel: bool (m,), which lie at infinity: light comes from there along their normals.
    """

    places: Array
    normals: Array
    parallel: Bools

    def take(self, chosen: Ints, origins: Array, far: float) -> Array:
        """Return where rays from `origins` (n, 3) to the points `chosen` (n,) end, `far` away where that is outside."""
        ends = self.places.take(chosen, axis=0)
        if self.parallel.any():
            rows = np.flatnonzero(self.parallel[chosen])
            ends[rows] = origins[rows] - far * self.normals[chosen[rows]]
        return ends


def find_seen(
    tracer: Tracer, at: Surfaces, points: PointsToSee, chosen: Ints, nobody: int, *, threads: int | None = None
) -> tuple[Ints, int]:
    """Return a bit for each point that a surface sees, uint32 (n,), and the number of rays.

    at: n surfaces. chosen: (n, k), k up to 32, which of the points each surface asks; `nobody` asks for none. Results
    do not depend on the number of `threads`.
    """
    far = 4 * tracer.scene.bounds.radius
    tasks = [slice(start, start + SURFACES) for start in range(0, len(chosen), SURFACES)]

    def work(rows: slice) -> tuple[Ints, int]:
        asked = chosen[rows] != nobody
        number = np.flatnonzero(asked)
        origins = tracer.lift(at.position[rows], at.normal[rows]).take(number // chosen.shape[1], axis=0)
        targets = points.take(chosen[rows].reshape(-1)[number], origins, far)
        seen = np.zeros(asked.shape, bool)
        seen.reshape(-1)[number] = ~tracer.occluded(origins, targets, lifted=True)
        packed = np.packbits(seen, axis=1, bitorder="little")
        bits: Ints = np.zeros((len(packed), 4), np.uint8)
        bits[:, : packed.shape[1]] = packed
        return bits, len(number)

    parts: list[Ints] = [np.zeros(0, np.uint32)]
    count = 0
    with closing(run_in_order(work, tasks, threads)) as results:
        for bits, rays in results:
            parts.append(bits.view("<u4")[:, 0])
            count += rays
    return np.concatenate(parts), count
