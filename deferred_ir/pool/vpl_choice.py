"""One VPL for each of many points, drawn by the light that it would bring: for points that no screen shows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from deferred_ir.base.arrays import Array, Ints
from deferred_ir.base.colour import LUMINANCE
from deferred_ir.rays.tracer import Hits, Tracer
from deferred_ir.vpls.kernel import TINY

CANDIDATES = 8
"""VPLs that each point draws by their power; of these it keeps one by the light that it would bring, without shadows
(resampled importance sampling: Talbot et al. 2005)."""


@dataclass(frozen=True, eq=False)
class VplChoice:
    """m VPLs, without points of lights.

    ends: sums of their powers up to each, (m,). position: about the scene's middle in units of its scale, where single
    precision is finest; normal, (m, 3); edge: cosine of half the cone's angle; clamp: squared, in those units, (m,).
    colour: emission over power, (m, 3). lifted: positions off their surfaces, world space.
    """

    tracer: Tracer
    ends: Array
    position: Array
    normal: Array
    edge: Array
    clamp: Array
    colour: Array
    lifted: Array

    @classmethod
    def from_records(cls, tracer: Tracer, records: np.ndarray) -> VplChoice:
        """Take VPL records (n,), of which points of lights have no cone."""
        own = records[(records["one_minus_cos"] < 1) & (records["emission"] > 0).any(axis=1)]
        emission, position = own["emission"].astype(np.float64), own["position"].astype(np.float64)
        power, geometry = emission @ LUMINANCE, tracer.scene.geometry
        return cls(
            tracer,
            np.cumsum(power),
            ((position - geometry.middle) / geometry.scale).astype(np.float32),
            np.ascontiguousarray(own["z_axis"]),
            1 - own["one_minus_cos"],
            (own["clamp_squared"] / geometry.scale**2).astype(np.float32),
            emission / power[:, None] if len(own) else emission,
            tracer.lift(position, own["z_axis"]),
        )

    def irradiate(self, at: Hits, rng: np.random.Generator) -> Array:
        """Return the irradiance on surfaces `at` (n, all hit) by one VPL each, shadows included, float64 (n, 3)."""
        count, most = len(at.face), len(self.ends) - 1
        irradiance = np.zeros((count, 3))
        if most < 0 or not count:
            return irradiance
        marks = (np.arange(CANDIDATES) + rng.random((count, CANDIDATES))) / CANDIDATES * self.ends[-1]
        drawn = np.minimum(np.searchsorted(self.ends, marks, side="right"), most)
        # Each candidate brings its power times this, and was drawn in proportion to its power.
        brought = self._weigh(at, drawn)
        stops = np.cumsum(brought, axis=1, dtype=np.float64)
        total = stops[:, -1]
        rows = np.flatnonzero(total > 0)
        column = (stops[rows] <= (rng.random(count) * total)[rows, None]).sum(axis=1).clip(max=CANDIDATES - 1)
        vpl = drawn[rows, column]
        starts = self.tracer.lift(at.position[rows], at.normal[rows])
        free = np.flatnonzero(~self.tracer.occluded(starts, self.lifted[vpl], lifted=True))
        level = total[rows[free]] * (self.ends[-1] / CANDIDATES / self.tracer.scene.geometry.scale**2)
        irradiance[rows[free]] = self.colour[vpl[free]] * level[:, None]
        return irradiance

    def _weigh(self, at: Hits, drawn: Ints) -> Array:
        """Return cos cos / max(d^2, c^2) of VPLs `drawn` (n, c), without shadows, float32 (n, c), over scale^-2."""
        geometry = self.tracer.scene.geometry
        position = ((at.position - geometry.middle) / geometry.scale).astype(np.float32)
        normal, shading = (vectors.astype(np.float32) for vectors in (at.normal, at.shading_normal))
        ways = [position[:, None, axis] - self.position[:, axis][drawn] for axis in range(3)]

        def along(vectors: Array) -> Array:
            total: Array = ways[0] * vectors[:, None, 0] + ways[1] * vectors[:, None, 1] + ways[2] * vectors[:, None, 2]
            return total

        square = ways[0] ** 2 + ways[1] ** 2 + ways[2] ** 2
        leaving = sum(way * self.normal[:, axis][drawn] for axis, way in enumerate(ways))
        weights: Array = np.maximum(leaving, 0) * np.maximum(-along(shading), 0)
        weights[(along(normal) >= 0) | (leaving <= 0) | (leaving**2 < self.edge[drawn] ** 2 * square)] = 0
        weights /= np.maximum(square, TINY) * np.maximum(np.maximum(square, self.clamp[drawn]), TINY)
        return weights
