"""Choose VPLs that light what the camera sees from among many candidates, unbiased.

A candidate's effect is estimated at PROBES pixels of the image: the light that it adds to a pixel, shadows included,
over the light that all candidates add there. Systematic resampling then draws a few, with probabilities that are in
part even and in part proportional to the root of the sum of the squared effects, which minimises the variance of
independent draws. A candidate's power is divided by its probability, so the mean stays the same.

Plain resampling would lose the stratification of the candidates and make most scenes worse. Along a Hilbert curve
through their positions and normals, neighbours replace each other and the stratification survives (Gerber, Chopin and
Whiteley 2019, "Negative association, ordering and convergence of resampling methods").

Candidates of all bounces take part in one draw: a VPL of any bounce is chosen for its effect on the image.

Sources: Segovia et al. 2006 (VPLs by their effect on the camera), Georgiev and Slusallek 2010 (probabilities from a
few pixels, mixed with even ones).
"""

from __future__ import annotations

from contextlib import closing

import numpy as np

from deferred_ir.base.arrays import Array
from deferred_ir.base.colour import LUMINANCE
from deferred_ir.base.parallel import run_in_order
from deferred_ir.rays.tracer import Hits, Tracer
from deferred_ir.sampling import streams
from deferred_ir.sampling.hilbert import find_hilbert_order
from deferred_ir.sampling.patterns import resample_systematically, sample_unit_square
from deferred_ir.scene.camera import Camera
from deferred_ir.vpls.cast import Vpls
from deferred_ir.vpls.kernel import VplLimits
from deferred_ir.vpls.ray_sum import ScaledSurfaces, ScaledVpls

PROBES = 128
"""Pixels at which effects are estimated."""
TRIES = 1024
"""Camera rays cast to find them: some may hit nothing."""
EVEN = 0.6
"""Fraction of the probability that is even: so no VPL becomes brighter than 1/EVEN times an unweighted one."""
PAIRS = 1 << 15
"""Pairs of pixel and candidate in a task: few enough for arrays to stay in a core's cache and rays in one thread."""
BITS = 10
"""Bits a coordinate on the curve."""


def find_probes(tracer: Tracer, camera: Camera, size: tuple[int, int], seed: int = 0) -> Hits:
    """Return the surfaces behind up to PROBES well-spread pixel centres of an image of `size` (width, height)."""
    pixels = np.floor(sample_unit_square("sobol", TRIES, streams.resampling_pattern(seed)) * size) + 0.5
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
        effect = np.divide(added, total, out=added, where=total > 0)
        squares: Array = np.einsum("ij,ij->j", effect, effect)
        return squares

    squares = np.zeros(len(vpls))
    with closing(run_in_order(work, tasks, threads)) as results:
        for part in results:
            squares += part
    return np.sqrt(squares)


def resample(vpls: Vpls, effect: Array, count: int, seed: int = 0) -> Vpls:
    """Draw about `count` of `vpls` (n), in the curve's order, as bright on average as all; all if there are no more.

    effect: float64 (n,); where all are 0, probabilities are even. A candidate drawn twice becomes one VPL of twice the
    power, so there may be fewer than `count`.
    """
    if len(vpls) <= count:
        return vpls
    even = np.full(len(vpls), 1 / len(vpls))
    total = effect.sum()
    probability = EVEN * even + (1 - EVEN) * effect / total if total > 0 else even
    order = find_hilbert_order(_cube_points(vpls), BITS)
    drawn = resample_systematically(probability[order], count, streams.resampling(seed).random())
    drawn, times = np.unique(drawn, return_counts=True)
    chosen = order[drawn]
    gain = times * probability.sum() / (count * probability[chosen])
    return Vpls(vpls.position[chosen], vpls.normal[chosen], vpls.emission[chosen] * gain[:, None], vpls.ray[chosen])


def _cube_points(vpls: Vpls) -> Array:
    """Return positions and normals in a unit cube, (n, 6); opposite normals are half of its edge apart."""
    low = vpls.position.min(axis=0)
    extent = max((vpls.position - low).max(), np.finfo(float).tiny)
    return np.column_stack([(vpls.position - low) / extent, (vpls.normal + 1) / 4])
