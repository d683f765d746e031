"""What the clamp on 1/d^2 takes, given back by short rays (Kollig and Keller 2004, Illumination in the Presence of Weak
Singularities).

VPLs light a point x with 1/d^2 * min(1, d^2/c^2). What is missing is an integral over the directions whose first hit y
lies nearer than c, of L(y) cos (1 - d^2/c^2), and cosine-distributed rays of length c estimate it without any
singularity. Together the two are exact. Rays carry on from y where VPLs have more than one bounce.

Each pixel of a block takes other cells of one stratification, so that the mean over any window of a block's size is
that of a well spread set: the image is made to be filtered. Each seed deals the cells anew, so that the mean over seeds
is right at every pixel.
"""

from __future__ import annotations

from contextlib import closing
from dataclasses import dataclass
from functools import lru_cache
from math import gcd

import numpy as np

from .direct_light import lit_by
from .lights import Spotlight
from .parallel import in_order
from .surfaces import Surfaces
from .tracing import Hits, Tracer
from .typing import Array, Ints

RAYS = 1 << 14
"""Rays of a task: few enough for their arrays to stay in a core's cache."""


@dataclass(frozen=True)
class VplLimits:
    """What VPLs leave out of the light nearby. clamp: c, world units. cosine: of half their cone's angle."""

    clamp: float
    cosine: float = 0.0

    def missing(self, square: Array, leaving: Array) -> Array:
        """The share of light that VPLs at a squared distance (n,) do not bring; `leaving`: cosine there, (n,).

        All of it outside their cone, and none from farther than c, where a cone's loss is theirs for good.
        """
        share: Array = np.maximum(1 - square / self.clamp**2, 0)
        share[(leaving < self.cosine) & (share > 0)] = 1
        return share


def residual(
    tracer: Tracer,
    light: Spotlight,
    seen: Surfaces,
    size: tuple[int, int],
    limits: VplLimits,
    *,
    samples: float,
    block: int,
    bounces: int = 1,
    seed: int = 0,
    threads: int | None = None,
) -> Array:
    """Irradiance that VPLs of `bounces` bounces miss, float32 (H, W, 4), bottom row first, unfiltered.

    size: (width, height). samples: rays a pixel, below 1 the share of pixels that trace one, above 1 a whole number.
    block: 1, 2, 4 or 8; the mean over any window of block x block pixels is right. alpha: weight of the pixel in that
    mean, 0 where no ray was traced or nothing was seen. The same for any number of threads.
    """
    width, height = size
    image = np.zeros((height * width, 4), np.float32)
    if limits.clamp <= 0:
        return image.reshape(height, width, 4)
    dealing = np.random.default_rng(seed)
    traced, index, total = _pattern(seen.pixel, width, samples, block, int(dealing.integers(block * block)))
    shift = dealing.random(2, np.float32)
    each = index.shape[1]
    weight = block * block * each / total
    per_task = max(1, RAYS // each)
    tasks = [(i, slice(start, start + per_task)) for i, start in enumerate(range(0, len(traced), per_task))]
    lattice = _lattice(total)
    rays, emission = _Rays(tracer, light, seen, limits, bounces), np.asarray(light.emission, float)

    def work(task: tuple[int, slice]) -> Array:
        number, chosen = task
        rng = np.random.default_rng([seed, number])
        rows = np.repeat(traced[chosen], each)
        points = (_points(index[chosen].reshape(-1), lattice, rng) + shift) % 1
        brought: Array = rays.bring(rows, points, rng).reshape(-1, each, 3).mean(axis=1) * emission
        return brought

    with closing(in_order(work, tasks, threads)) as results:
        for (_, chosen), part in zip(tasks, results, strict=True):
            pixels = seen.pixel[traced[chosen]]
            image[pixels, :3] = part * weight
            image[pixels, 3] = weight
    return image.reshape(height, width, 4)


@dataclass(frozen=True, eq=False)
class _Rays:
    """Short rays from what is seen, and how they carry on."""

    tracer: Tracer
    light: Spotlight
    seen: Surfaces
    limits: VplLimits
    bounces: int

    def bring(self, rows: Ints, points: Array, rng: np.random.Generator) -> Array:
        """Irradiance over emission that one ray from each of the surfaces `rows` brings, float64 (n, 3)."""
        tracer, position, normal = self.tracer, self.seen.position[rows], self.seen.normal[rows]
        directions, above = _about(self.seen.shading_normal[rows], normal, points)
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
            carried[rays] += throughput * lit_by(self.light, tracer, at, rng)[:, None]
        return carried

    def _carry_on(self, rays: Ints, throughput: Array, at: Hits, rng: np.random.Generator) -> tuple[Ints, Array, Hits]:
        """One bounce more: what is left of the rays, and where they land."""
        directions, above = _about(at.shading_normal, at.normal, rng.random((len(rays), 2)))
        start = self.tracer.lift(at.position[above], at.normal[above])
        found, landed = self.tracer.within(start, directions[above], np.inf)
        kept = above[found]
        return rays[kept], throughput[kept] * landed.albedo, landed


def _about(shading_normals: Array, normals: Array, points: Array) -> tuple[Array, Ints]:
    """Unit directions, cosine-distributed about shading normals (n, 3), and the rows of those above their face.

    A unit normal plus a point of the unit sphere (Archimedes' map of `points`, (n, 2)), which needs no frame.
    """
    height, angle = 1 - 2 * points[:, 0], 2 * np.pi * points[:, 1]
    radius = np.sqrt(np.maximum(1 - height * height, 0))
    directions = shading_normals + np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=1)
    square = np.einsum("ij,ij->i", directions, directions)
    above = np.flatnonzero((np.einsum("ij,ij->i", directions, normals) > 0) & (square > 0))
    directions /= np.sqrt(np.maximum(square, np.finfo(directions.dtype).tiny))[:, None]
    return directions, above


def _pattern(pixel: Ints, width: int, samples: float, block: int, turn: int) -> tuple[Ints, Ints, int]:
    """Rows of `pixel` that trace, numbers of their rays' cells (m, rays a pixel), and how many cells a block has.

    turn: below block^2, which way of dealing the cells to the pixels.
    """
    cells = block * block
    y, x = np.divmod(pixel, width)
    rank = _ranks(block)[y % block, x % block] ^ turn
    if samples < 1:
        few = max(round(cells * samples), 1)
        traced = np.flatnonzero(rank < few)
        return traced, rank[traced, None], few
    each = round(samples)
    return np.arange(len(pixel)), rank[:, None] + cells * np.arange(each), cells * each


@lru_cache
def _ranks(block: int) -> Ints:
    """Bayer's ordered dither: the numbers below block^2, neighbours far apart, and any first few spread evenly."""
    ranks = np.zeros((1, 1), int)
    while len(ranks) < block:
        ranks = np.block([[4 * ranks, 4 * ranks + 2], [4 * ranks + 3, 4 * ranks + 1]])
    return ranks


@lru_cache
def _lattice(count: int) -> tuple[int, int, Array]:
    """A rank-1 lattice of `count` points (i, g i mod count) / count: count, g, and its two shortest steps (2, 2).

    g makes the longer of the steps as short as it can be.
    """
    best: tuple[float, int, Array] | None = None
    for g in range(1, count + 1):
        if gcd(g, count) == 1:
            steps = _reduced(np.array([1, g]), np.array([0, count]))
            longer = float((steps[1] ** 2).sum())
            if best is None or longer < best[0]:
                best = longer, g, steps / count
    assert best  # 1 is coprime to every count
    return count, best[1], best[2].astype(np.float32)


def _reduced(a: Ints, b: Ints) -> Ints:
    """The lattice of integer vectors a and b by its two shortest steps, the shorter first (Gauss's reduction)."""
    while True:
        if a @ a > b @ b:
            a, b = b, a
        times = round(float(a @ b) / float(a @ a))
        if times == 0:
            return np.stack([a, b])
        b = b - times * a


def _points(index: Ints, lattice: tuple[int, int, Array], rng: np.random.Generator) -> Array:
    """A random point in the cell of each lattice point, float32 (n, 2). Cells are parallelograms that tile it."""
    count, g, steps = lattice
    jitter = rng.random((len(index), 2), np.float32) @ steps
    corner = np.stack([index, index * g % count], axis=1).astype(np.float32) / np.float32(count)
    points: Array = (corner + jitter) % 1
    return points
