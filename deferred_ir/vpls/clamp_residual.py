"""Restore by short rays the light that the clamp on 1/d^2 takes (Kollig and Keller 2004, "Illumination in the Presence
of Weak Singularities").

VPLs light a point x with 1/d^2 * min(1, d^2/c^2). What is missing is the integral of L(y) cos (1 - d^2/c^2) over the
directions whose first hit y lies nearer than c. Cosine-distributed rays of length c estimate it without any
singularity, and together the two are exact. Where VPLs have more than one bounce, rays carry on from y.

The pixels of a block take different cells of one stratification, so that the samples in any window of a block's size
are well spread: the image is made to be filtered. Each seed deals the cells anew, so that the mean over seeds is right
at every pixel.
"""

from __future__ import annotations

from contextlib import closing
from dataclasses import dataclass

import numpy as np

from deferred_ir.base.arrays import Array, Ints
from deferred_ir.base.parallel import run_in_order
from deferred_ir.rays.direct import compute_irradiance
from deferred_ir.rays.pixel_surfaces import PixelJob, Surfaces
from deferred_ir.rays.tracer import Hits, Tracer
from deferred_ir.sampling import pixel_blocks, streams
from deferred_ir.vpls.kernel import VplLimits

RAYS = 1 << 14
"""Rays of a task: few enough for their arrays to stay in a core's cache."""


def trace_residual(job: PixelJob, limits: VplLimits, *, samples: float, bounces: int = 1) -> Array:
    """Return the irradiance that VPLs of `bounces` bounces miss, float32 (H, W, 4), bottom row first as in OpenGL.

    The image is not filtered yet: the mean over any window of block x block pixels is right. alpha is a pixel's weight
    in it, 0 where no ray was traced or nothing was seen. samples: rays a pixel; below 1 the fraction of pixels that
    trace one, above 1 a whole number.
    """
    seen, seed, block, (width, height) = job.seen, job.seed, job.block, job.size
    image = np.zeros((height * width, 4), np.float32)
    if limits.clamp <= 0:
        return image.reshape(height, width, 4)
    dealing = streams.residual_blocks(seed)
    traced, index, total = pixel_blocks.deal(seen.pixel, width, samples, block, int(dealing.integers(block * block)))
    shift = dealing.random(2, np.float32)
    each = index.shape[1]
    weight = block * block * each / total
    per_task = max(1, RAYS // each)
    tasks = [(i, slice(start, start + per_task)) for i, start in enumerate(range(0, len(traced), per_task))]
    lattice = pixel_blocks.find_lattice(total)
    rays, emission = _Rays(job.tracer, seen, limits, bounces), np.asarray(job.tracer.scene.spotlight.emission, float)

    def work(task: tuple[int, slice]) -> Array:
        number, chosen = task
        rng = streams.residual_rays(seed, number)
        rows = np.repeat(traced[chosen], each)
        points = (pixel_blocks.jitter(index[chosen].reshape(-1), lattice, rng) + shift) % 1
        irradiance: Array = rays.trace(rows, points, rng).reshape(-1, each, 3).mean(axis=1) * emission
        return irradiance

    with closing(run_in_order(work, tasks, job.threads)) as results:
        for (_, chosen), part in zip(tasks, results, strict=True):
            pixels = seen.pixel[traced[chosen]]
            image[pixels, :3] = part * weight
            image[pixels, 3] = weight
    return image.reshape(height, width, 4)


@dataclass(frozen=True, eq=False)
class _Rays:
    """Short rays from the surfaces `seen`, and the bounces that follow."""

    tracer: Tracer
    seen: Surfaces
    limits: VplLimits
    bounces: int

    def trace(self, rows: Ints, points: Array, rng: np.random.Generator) -> Array:
        """Return the irradiance over emission that one ray from each of the surfaces `rows` brings, float64 (n, 3)."""
        tracer, position, normal = self.tracer, self.seen.position[rows], self.seen.normal[rows]
        directions, above = _sample_directions(self.seen.shading_normal[rows], normal, points)
        start = tracer.lift(position[above], normal[above])
        found, at = tracer.within(start, directions[above], self.limits.clamp + tracer.offset)
        rays = above[found]
        way = position[rays] - at.position
        square = np.einsum("ij,ij->i", way, way)
        leaving = np.einsum("ij,ij->i", way, at.normal) / np.sqrt(np.maximum(square, np.finfo(float).tiny))
        carried = np.zeros((len(rows), 3))
        throughput: Array = at.albedo * self.limits.missing(square, leaving)[:, None]
        for bounce in range(self.bounces):
            if bounce:
                rays, throughput, at = self._carry_on(rays, throughput, at, rng)
            carried[rays] += throughput * compute_irradiance(tracer.scene.spotlight, tracer, at, rng)[:, None]
        return carried

    def _carry_on(self, rays: Ints, throughput: Array, at: Hits, rng: np.random.Generator) -> tuple[Ints, Array, Hits]:
        """Follow rays for another bounce. Returns those that hit something, their throughputs and their hits."""
        directions, above = _sample_directions(at.shading_normal, at.normal, rng.random((len(rays), 2)))
        start = self.tracer.lift(at.position[above], at.normal[above])
        found, landed = self.tracer.within(start, directions[above], np.inf)
        hit = above[found]
        return rays[hit], throughput[hit] * landed.albedo, landed


def _sample_directions(shading_normals: Array, normals: Array, points: Array) -> tuple[Array, Ints]:
    """Return unit directions, cosine-distributed about shading normals (n, 3), and the rows of those above their face.

    Each is a unit normal plus a point of the unit sphere (Archimedes' map of `points`, (n, 2)), which needs no basis.
    """
    height, angle = 1 - 2 * points[:, 0], 2 * np.pi * points[:, 1]
    radius = np.sqrt(np.maximum(1 - height * height, 0))
    directions = shading_normals + np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=1)
    square = np.einsum("ij,ij->i", directions, directions)
    above = np.flatnonzero((np.einsum("ij,ij->i", directions, normals) > 0) & (square > 0))
    directions /= np.sqrt(np.maximum(square, np.finfo(directions.dtype).tiny))[:, None]
    return directions, above
