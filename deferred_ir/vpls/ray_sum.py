"""Sum the light of VPLs with ray-cast visibility: what a render of the same VPLs would be with perfect shadow maps."""

from __future__ import annotations

from contextlib import closing
from dataclasses import dataclass

import numpy as np

from deferred_ir.base.arrays import Array
from deferred_ir.base.parallel import run_in_order
from deferred_ir.base.progress import Progress
from deferred_ir.rays.tracer import Hits, Tracer
from deferred_ir.vpls.cast import Vpls
from deferred_ir.vpls.kernel import VplLimits, weigh

PIXELS = 1 << 14
"""Pixels of a task: few enough for their arrays to stay in a core's cache."""

VPLS = 64
"""VPLs of a task."""


@dataclass(frozen=True, eq=False)
class ScaledVpls:
    """VPLs as the innermost loop reads them: float32 (n, 3) each.

    position: about the scene's middle, in units of its scale. lifted: in world space, off their surfaces. emission:
    float64. edge: squared cosine of half the cone's angle. clamp: c^2, in squared scales.
    """

    position: Array
    normal: Array
    lifted: Array
    emission: Array
    edge: np.float32
    clamp: np.float32

    @classmethod
    def from_vpls(cls, tracer: Tracer, vpls: Vpls, limits: VplLimits) -> ScaledVpls:
        """Convert VPLs of the tracer's scene."""
        return cls(
            _scale(tracer, vpls.position).astype(np.float32),
            vpls.normal.astype(np.float32),
            tracer.lift(vpls.position, vpls.normal).astype(np.float32),
            vpls.emission,
            limits.edge,
            np.float32((limits.clamp / tracer.scene.geometry.scale) ** 2),
        )


class ScaledSurfaces:
    """Surfaces behind some pixels, float32 (3, n), positions about the scene's middle in units of its scale.

    There single precision is finest, and fourth powers of distances fit in it, whatever the scene's unit.
    """

    def __init__(self, tracer: Tracer, seen: Hits) -> None:
        self.tracer = tracer
        self.position = np.ascontiguousarray(_scale(tracer, seen.position).T, np.float32)
        self.normal = np.ascontiguousarray(seen.normal.T, np.float32)
        self.shading_normal = np.ascontiguousarray(seen.shading_normal.T, np.float32)
        self.lifted = tracer.lift(seen.position, seen.normal).astype(np.float32)

    def weigh_pairs(self, vpls: ScaledVpls) -> Array:
        """Return cos cos V / max(d^2, c^2) of n surfaces and m VPLs, times the squared scale, float32 (n, m)."""
        position, normal = (np.ascontiguousarray(part.T)[:, None] for part in (vpls.position, vpls.normal))
        way = self.position[..., None] - position
        normals = self.normal[..., None], self.shading_normal[..., None]
        weights = weigh(way, normal, *normals, edge=vpls.edge, clamp=vpls.clamp)
        pixel, vpl = np.nonzero(weights)
        hidden = self.tracer.occluded(self.lifted[pixel], vpls.lifted[vpl], lifted=True)
        weights[pixel[hidden], vpl[hidden]] = 0
        return weights

    def sum_irradiance(self, vpls: ScaledVpls, chosen: slice) -> Array:
        """Return the irradiance by the VPLs `chosen`, times the squared scale, float64 (3, n)."""
        total = np.zeros(self.position.shape)
        for i in range(chosen.start, chosen.stop):
            if not vpls.emission[i].any():
                continue
            way = self.position - vpls.position[i][:, None]
            weights = weigh(way, vpls.normal[i], self.normal, self.shading_normal, edge=vpls.edge, clamp=vpls.clamp)
            lit = np.flatnonzero(weights)
            if len(lit) == 0:
                continue
            targets = np.broadcast_to(vpls.lifted[i], (len(lit), 3))
            weights[lit[self.tracer.occluded(self.lifted[lit], targets, lifted=True)]] = 0
            for channel in range(3):
                total[channel] += weights * vpls.emission[i, channel]
        return total


def _scale(tracer: Tracer, positions: Array) -> Array:
    """Return positions (n, 3) about the middle of the tracer's scene, in units of its scale."""
    geometry = tracer.scene.geometry
    scaled: Array = (positions - geometry.middle) / geometry.scale
    return scaled


def sum_radiance(
    tracer: Tracer,
    seen: Hits,
    vpls: Vpls,
    limits: VplLimits,
    *,
    threads: int | None = None,
    progress: Progress | None = None,
) -> Array:
    """Return the radiance that surfaces `seen` (n) reflect of all `vpls`, float64 (n, 3); 0 in rows that hit nothing.

    The result does not depend on the number of `threads`. progress: called with the tasks done and all there are.
    """
    pixels = np.flatnonzero(seen.hit)
    scaled = ScaledVpls.from_vpls(tracer, vpls, limits)
    patches = [pixels[start : start + PIXELS] for start in range(0, len(pixels), PIXELS)]
    blocks = [slice(start, min(start + VPLS, len(vpls))) for start in range(0, len(vpls), VPLS)]
    surfaces = [ScaledSurfaces(tracer, seen.rows(rows)) for rows in patches]
    tasks = [(patch, block) for patch in range(len(patches)) for block in blocks]
    total = np.zeros((len(seen.face), 3))
    with closing(
        run_in_order(lambda task: surfaces[task[0]].sum_irradiance(scaled, task[1]), tasks, threads)
    ) as results:
        for done, ((patch, _), part) in enumerate(zip(tasks, results, strict=True), start=1):
            total[patches[patch]] += part.T
            if progress:
                progress(done, len(tasks))
    radiance: Array = total * seen.albedo / (np.pi * tracer.scene.geometry.scale**2)
    return radiance
