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

from deferred_ir.base.arrays import Array, Bools, Ints
from deferred_ir.base.parallel import run_in_order
from deferred_ir.rays.direct import AllLight
from deferred_ir.rays.pixel_surfaces import PixelJob, Surfaces
from deferred_ir.rays.tracer import Hits, Tracer
from deferred_ir.sampling import pixel_blocks, streams
from deferred_ir.vpls.kernel import VplLimits

NOWHERE = -1.0
"""Reach of a ray that is not traced."""
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
    light = AllLight(job.tracer)
    rays, emission = _Rays(job.tracer, seen, limits, bounces, light), light.unit

    def work(task: tuple[int, slice]) -> tuple[Ints, Array]:
        number, chosen = task
        rng = streams.residual_rays(seed, number)
        points = (pixel_blocks.jitter(index[chosen].reshape(-1), lattice, rng) + shift) % 1
        found, irradiance = rays.trace(traced[chosen], each, points, rng)
        return seen.pixel[traced[chosen]][found // each], irradiance * (emission * weight / each)

    image[seen.pixel[traced], 3] = weight
    with closing(run_in_order(work, tasks, job.threads)) as results:
        parts = list(results)
    if parts:  # a pixel may have several rays
        pixels, irradiance = (np.concatenate(column) for column in zip(*parts, strict=True))
        for channel in range(3):
            image[:, channel] = np.bincount(pixels, irradiance[:, channel], len(image))
    return image.reshape(height, width, 4)


@dataclass(frozen=True, eq=False)
class _Rays:
    """Short rays from the surfaces `seen`, and the bounces that follow."""

    tracer: Tracer
    seen: Surfaces
    limits: VplLimits
    bounces: int
    light: AllLight

    def trace(self, rows: Ints, each: int, points: Array, rng: np.random.Generator) -> tuple[Ints, Array]:
        """Trace `each` rays from each of the surfaces `rows` (n,). Few meet a surface that is near.

        points: float32 (n * each, 2), in [0, 1). Returns the numbers of the rays that do, (m,), ascending, and the
        irradiance over the light's unit that each brings, float64 (m, 3).
        """
        tracer, seen = self.tracer, self.seen.rows(rows)
        surface = np.repeat(np.arange(len(rows)), each)
        shading = seen.shading_normal.take(surface, axis=0)
        normal = shading if seen.normal is seen.shading_normal else seen.normal.take(surface, axis=0)
        directions, above = _sample_directions(shading, normal, points)
        start = tracer.lift(seen.position, seen.normal).take(surface, axis=0)
        reach = np.where(above, np.float32(self.limits.clamp + tracer.offset), np.float32(NOWHERE))
        rays, at = tracer.within(start, directions, reach)
        way = seen.position[surface[rays]] - at.position
        square = np.einsum("ij,ij->i", way, way)
        leaving = np.einsum("ij,ij->i", way, at.normal) / np.sqrt(np.maximum(square, np.finfo(float).tiny))
        found, carried = rays, np.zeros((len(rays), 3))
        row: Ints = np.arange(len(rays))
        throughput: Array = at.reflect_diffusely(directions[rays]) * self.limits.missing(square, leaving)[:, None]
        for bounce in range(self.bounces):
            if bounce:
                row, throughput, at = self._carry_on(row, throughput, at, rng)
            carried[row] += throughput * self.light.irradiate(at, rng)
        return found, carried

    def _carry_on(self, row: Ints, throughput: Array, at: Hits, rng: np.random.Generator) -> tuple[Ints, Array, Hits]:
        """Follow rays for another bounce. Returns those that hit something, their throughputs and their hits."""
        directions, above = _sample_directions(at.shading_normal.copy(), at.normal, rng.random((len(row), 2)))
        start = self.tracer.lift(at.position, at.normal)
        hit, landed = self.tracer.within(start, directions, np.where(above, np.inf, NOWHERE))
        return row[hit], throughput[hit] * landed.reflect_diffusely(directions[hit]), landed


def _sample_directions(shading_normals: Array, normals: Array, points: Array) -> tuple[Array, Bools]:
    """Return unit directions, cosine-distributed about shading normals (n, 3), and whether each is above its face.

    Each is a unit normal plus a point of the unit sphere (Archimedes' map of `points`, (n, 2)), which needs no basis.
    The array of shading normals is written over.
    """
    height, angle = 1 - 2 * points[:, 0], 2 * np.pi * points[:, 1]
    radius = np.sqrt(np.maximum(1 - height * height, 0))
    parts = radius * np.cos(angle), radius * np.sin(angle), height
    above = np.ones(len(points), bool)
    if normals is not shading_normals:
        cosine = np.einsum("ij,ij->i", normals, shading_normals)
        for axis, part in enumerate(parts):
            cosine += normals[:, axis] * part
        above = cosine > 0
    directions = shading_normals
    for axis, part in enumerate(parts):
        directions[:, axis] += part
    square = np.einsum("ij,ij->i", directions, directions)
    above &= square > 0
    directions /= np.sqrt(np.maximum(square, np.finfo(directions.dtype).tiny))[:, None]
    return directions, above
