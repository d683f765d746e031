"""VPLs where the camera needs them: of many candidates those are kept that light what it sees, unbiased.

Each candidate's effect on the image is estimated at PROBES of its pixels: what it adds to a pixel, shadow ray
included, over what all candidates together add there. Systematic resampling then draws a few, with probabilities that
are partly even and partly go with the root of the sum of the squared effects, which makes the variance of
independent draws least. A candidate's power is divided by its probability, so the mean stays what it was.

Plain resampling would throw the stratification of the candidates away and make most scenes worse. Along a Hilbert
curve through their positions and normals neighbours stand for each other, and it survives (Gerber, Chopin and
Whiteley 2019, "Negative association, ordering and convergence of resampling methods").

Of candidates of several bounces all take part in one draw: a VPL of any bounce is kept for what it does to the image.

Sources: Segovia et al. 2006 (VPLs by their effect on the camera), Georgiev and Slusallek 2010 (probabilities from a
few pixels, mixed with even ones).
"""

from __future__ import annotations

from contextlib import closing

import numpy as np

from deferred_ir.base.arrays import Array
from deferred_ir.base.colour import LUMINANCE
from deferred_ir.base.parallel import in_order
from deferred_ir.rays.tracer import Hits, Tracer
from deferred_ir.sampling import streams
from deferred_ir.sampling.hilbert import hilbert_order
from deferred_ir.sampling.patterns import systematic, unit_square
from deferred_ir.scene.camera import Camera
from deferred_ir.vpls.cast import Vpls
from deferred_ir.vpls.kernel import VplLimits
from deferred_ir.vpls.ray_sum import ScaledSurfaces, ScaledVpls

PROBES = 128
"""Pixels at which effects are estimated."""
TRIES = 1024
"""Camera rays cast to find them: some may meet nothing."""
EVEN = 0.6
"""Share of the probability that all candidates have alike: no VPL becomes brighter than 1/EVEN times a plain one."""
PAIRS = 1 << 15
"""Pairs of pixel and candidate in a task: their arrays stay in a core's cache, and its rays in one thread."""
BITS = 10
"""Bits a coordinate on the curve."""


def find_probes(tracer: Tracer, camera: Camera, size: tuple[int, int], seed: int = 0) -> Hits:
    """Return the surfaces behind up to PROBES well-spread pixel centres of an image of `size` (width, height)."""
    pixels = np.floor(unit_square("sobol", TRIES, streams.resampling_pattern(seed)) * size) + 0.5
    x, y = (pixels / size * 2 - 1).T
    directions = np.column_stack([x, y, np.ones(TRIES)]) @ camera.ray_axes(size)
    seen = tracer.closest(np.broadcast_to(np.asarray(camera.position, float), directions.shape), directions)
    return seen.rows(np.flatnonzero(seen.hit)[:PROBES])


def estimate_effects(tracer: Tracer, seen: Hits, vpls: Vpls, limits: VplLimits, *, threads: int | None = None) -> Array:
    """Return the effect of each of `vpls` (n) on the surfaces `seen`, float64 (n,), in no unit; 0 if it lights none.

    The result does not depend on the number of `threads`.
    """
    scaled = ScaledVpls.from_vpls(tracer, vpls, limits)
    power = vpls.emission @ LUMINANCE
    power = (power / power.max(initial=np.finfo(float).tiny)).astype(np.float32)
    step = max(1, PAIRS // max(len(vpls), 1))
    pixels = np.arange(len(seen.face))
    tasks = [ScaledSurfaces(tracer, seen.rows(pixels[start : start + step])) for start in range(0, len(pixels), step)]

    def work(surfaces: ScaledSurfaces) -> Array:
        added = surfaces.weigh_pairs(scaled) * power
        total = added.sum(axis=1, keepdims=True)
        share = np.divide(added, total, out=added, where=total > 0)
        squares: Array = np.einsum("ij,ij->j", share, share)
        return squares

    squares = np.zeros(len(vpls))
    with closing(in_order(work, tasks, threads)) as results:
        for part in results:
            squares += part
    return np.sqrt(squares)


def resample(vpls: Vpls, effect: Array, count: int, seed: int = 0) -> Vpls:
    """About `count` of `vpls` (n), as bright on average as all, in the curve's order; all if there are no more.

    effect: float64 (n,). Where it is 0 everywhere, probabilities are even. One that is drawn twice is one VPL of
    twice the power, so that there may be fewer than `count`.
    """
    if len(vpls) <= count:
        return vpls
    even = np.full(len(vpls), 1 / len(vpls))
    total = effect.sum()
    probability = EVEN * even + (1 - EVEN) * effect / total if total > 0 else even
    order = hilbert_order(_places(vpls), BITS)
    drawn = systematic(probability[order], count, streams.resampling(seed).random())
    drawn, times = np.unique(drawn, return_counts=True)
    kept = order[drawn]
    gain = times * probability.sum() / (count * probability[kept])
    return Vpls(vpls.position[kept], vpls.normal[kept], vpls.emission[kept] * gain[:, None], vpls.ray[kept])


def _places(vpls: Vpls) -> Array:
    """Positions and normals in a unit cube, (n, 6): opposite normals are half of its edge apart."""
    low = vpls.position.min(axis=0)
    extent = max((vpls.position - low).max(), np.finfo(float).tiny)
    return np.column_stack([(vpls.position - low) / extent, (vpls.normal + 1) / 4])
