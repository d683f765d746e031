"""Direct irradiance by one light with ray-cast shadows, by the formulas of shaders/lib/lights."""

from __future__ import annotations

from contextlib import closing

import numpy as np

from deferred_ir.base.arrays import Array
from deferred_ir.base.parallel import run_in_order
from deferred_ir.rays.pixel_surfaces import PixelJob, Surfaces
from deferred_ir.rays.tracer import Hits, Tracer
from deferred_ir.sampling import pixel_blocks, streams
from deferred_ir.sampling.warps import square_to_disc
from deferred_ir.scene.lights.base import Light

PIXELS = 1 << 13
"""Pixels of a task: few enough for their arrays to stay in a core's cache."""

GOLDEN_ANGLE = np.pi * (3 - 5**0.5)


def compute_irradiance(light: Light, tracer: Tracer, at: Hits, rng: np.random.Generator) -> Array:
    """Return the irradiance on surfaces `at` (n, all hit) divided by the light's emission, float64 (n,).

    A light that has an area is sampled at one random point for each surface.
    """
    points = square_to_disc(rng.random((len(at.face), 2))) if light.has_area else None
    return _irradiate(light, tracer, at, points)


def trace_spotlight(job: PixelJob, *, samples: int) -> Array:
    """Return the spotlight's irradiance over its emission, float32 (H, W), bottom row first as in OpenGL.

    It is 0 on the background, and exact for a point light. A disc is sampled at `samples` points a pixel, spread over
    it together by the pixels of a block; the mean over seeds is exact.
    """
    tracer, seen, seed, block = job.tracer, job.seen, job.seed, job.block
    light, (width, height) = tracer.scene.spotlight, job.size
    image = np.zeros(height * width, np.float32)
    tasks = [(i, slice(start, start + PIXELS)) for i, start in enumerate(range(0, len(seen.pixel), PIXELS))]
    dealing = streams.shadow_blocks(seed)
    _, index, cells = pixel_blocks.deal(seen.pixel, width, 1, block, int(dealing.integers(block * block)))
    shift, grid = dealing.random(2), pixel_blocks.find_lattice(cells)

    def work(task: tuple[int, slice]) -> Array:
        number, rows = task
        at = seen.rows(rows)
        if not light.has_area:
            return _irradiate(light, tracer, at, None)
        places = pixel_blocks.jitter(index[rows, 0], grid, streams.shadow_rays(seed, number)) + shift
        total = np.zeros(len(at.pixel))
        for i in range(samples):
            total += _irradiate(light, tracer, at, _spiral(places % 1, i, samples))
        return total / samples

    with closing(run_in_order(work, tasks, job.threads)) as results:
        for (_, rows), part in zip(tasks, results, strict=True):
            image[seen.pixel[rows]] = part
    return image.reshape(height, width)


def _spiral(places: Array, i: int, count: int) -> Array:
    """Return point i of `count` points spread over the unit disc, for each row of `places` (n, 2) in [0, 1), (n, 2).

    The points form Vogel's spiral, rotated by the first coordinate; the second says where in its ring of equal area a
    point lies, so that evenly spread places give evenly spread points.
    """
    radius = np.sqrt((i + places[:, 1]) / count)
    angle = 2 * np.pi * places[:, 0] + i * GOLDEN_ANGLE
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)


def _irradiate(light: Light, tracer: Tracer, at: Hits | Surfaces, points: Array | None) -> Array:
    """Return irradiance over emission on n surfaces, float64 (n,); points: on the unit disc of a disc light, (n, 2)."""
    source = light.locate(points, len(at.position))
    to = source - at.position
    square = np.maximum(_dot(to, to), np.finfo(float).tiny)
    to /= np.sqrt(square)[:, None]
    facing = _dot(to, at.normal) > 0
    strength = np.maximum(_dot(to, at.shading_normal), 0) * facing
    strength *= light.radiate(-to) / square
    lit = np.flatnonzero(strength)
    starts = tracer.lift(at.position[lit], at.normal[lit])
    strength[lit[tracer.occluded(starts, source[lit])]] = 0
    return strength


def _dot(a: Array, b: Array) -> Array:
    products: Array = np.einsum("ij,ij->i", a, b)
    return products
