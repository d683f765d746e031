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
    """VPL records (m,) without points of lights, and the sums of their powers up to each, (m,)."""

    tracer: Tracer
    records: np.ndarray
    ends: Array
    lifted: Array

    @classmethod
    def from_records(cls, tracer: Tracer, records: np.ndarray) -> VplChoice:
        """Take VPL records (n,), of which points of lights have no cone."""
        own = records[(records["one_minus_cos"] < 1) & (records["emission"] > 0).any(axis=1)]
        ends = np.cumsum(own["emission"].astype(np.float64) @ LUMINANCE)
        return cls(tracer, own, ends, tracer.lift(own["position"].astype(np.float64), own["z_axis"]))

    def irradiate(self, at: Hits, rng: np.random.Generator) -> Array:
        """Return the irradiance on surfaces `at` (n, all hit) by one VPL each, shadows included, float64 (n, 3)."""
        count = len(at.face)
        if not len(self.records) or not count:
            return np.zeros((count, 3))
        marks = (np.arange(CANDIDATES) + rng.random((count, CANDIDATES))) / CANDIDATES * self.ends[-1]
        drawn = np.minimum(np.searchsorted(self.ends, marks, side="right"), len(self.records) - 1)
        brought = self._bring(at, drawn)
        power = self.records["emission"].astype(np.float64)[drawn] @ LUMINANCE
        # What a candidate would bring over the density that it was drawn with.
        weights = brought * (self.ends[-1] * (power > 0))
        total = weights.sum(axis=1)
        stops = np.cumsum(weights, axis=1)
        column = (stops < (rng.random(count) * total)[:, None]).sum(axis=1).clip(max=CANDIDATES - 1)
        rows = np.arange(count)
        vpl, kept = drawn[rows, column], np.flatnonzero(total > 0)
        chosen = self.records["emission"][vpl].astype(np.float64)
        irradiance: Array = chosen / np.maximum(power[rows, column], np.finfo(float).tiny)[:, None]
        irradiance *= (total / CANDIDATES)[:, None]
        starts = self.tracer.lift(at.position[kept], at.normal[kept])
        hidden = self.tracer.occluded(starts, self.lifted[vpl[kept]], lifted=True)
        irradiance[total <= 0] = 0
        irradiance[kept[hidden]] = 0
        return irradiance

    def _bring(self, at: Hits, drawn: Ints) -> Array:
        """Return the irradiance over emission that VPLs `drawn` (n, c) bring, without shadows, (n, c)."""
        records = self.records[drawn]
        way = at.position[:, None] - records["position"]
        square = np.einsum("ncj,ncj->nc", way, way)
        leaving = np.maximum(np.einsum("ncj,ncj->nc", records["z_axis"], way), 0)
        arriving = np.maximum(-np.einsum("nj,ncj->nc", at.shading_normal, way), 0)
        arriving[np.einsum("nj,ncj->nc", at.normal, way) >= 0] = 0
        edge = 1 - records["one_minus_cos"]
        leaving[leaving**2 < edge**2 * square] = 0
        held = np.maximum(square, records["clamp_squared"])
        brought: Array = leaving * arriving / np.maximum(square, TINY) / np.maximum(held, TINY)
        return brought
