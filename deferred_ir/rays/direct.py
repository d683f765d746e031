"""Direct irradiance by one light with ray-cast shadows, by the formulas of shaders/lib/lights."""

from __future__ import annotations

from contextlib import closing
from dataclasses import replace

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


class AllLight:
    """The direct light of everything that shines, sampled at one random point of what has an area.

    unit: linear RGB (3,) that its irradiance is relative to: the emission of an only light, else 1.
    """

    def __init__(self, tracer: Tracer) -> None:
        self._tracer, self._lights = tracer, tracer.scene.emitters
        self.unit = np.asarray(self._lights[0].emission if len(self._lights) == 1 else (1.0, 1.0, 1.0), float)

    def irradiate(self, at: Hits, rng: np.random.Generator) -> Array:
        """Return the irradiance on surfaces `at` (n, all hit) over `unit`, float64 (n, 3) or (n, 1)."""
        total: Array = np.zeros((len(at.face), 1))
        for light in self._lights:
            places = square_to_disc(rng.random((len(at.face), 2))) if light.has_area else None
            arriving = irradiate(light, self._tracer, at, places)
            total = total + arriving * (np.asarray(light.emission) / self.unit) if len(self._lights) > 1 else arriving
        return total


def trace_light(job: PixelJob, light: Light, *, samples: int) -> Array:
    """Return a light's irradiance over its emission, float32 (H * W,), bottom row first as in OpenGL.

    It is 0 on the background, and exact for a light without area. Others are sampled at `samples` points a pixel,
    spread over them together by the pixels of a block; the mean over seeds is exact.
    """
    tracer, seen, seed, block = job.tracer, job.seen, job.seed, job.block
    width, height = job.size
    image = np.zeros(height * width, np.float32)
    tasks = [(i, slice(start, start + PIXELS)) for i, start in enumerate(range(0, len(seen.pixel), PIXELS))]
    dealing = streams.shadow_blocks(seed)
    _, index, cells = pixel_blocks.deal(seen.pixel, width, 1, block, int(dealing.integers(block * block)))
    shift, grid = dealing.random(2), pixel_blocks.find_lattice(cells)

    def work(task: tuple[int, slice]) -> Array:
        number, rows = task
        at = seen.rows(rows)
        if not light.has_area:
            return irradiate(light, tracer, at, None)[:, 0]
        places = pixel_blocks.jitter(index[rows, 0], grid, streams.shadow_rays(seed, number)) + shift
        total = np.zeros(len(at.pixel))
        for i in range(samples):
            total += irradiate(light, tracer, at, _spiral(places % 1, i, samples))[:, 0]
        return total / samples

    with closing(run_in_order(work, tasks, job.threads)) as results:
        for (_, rows), part in zip(tasks, results, strict=True):
            image[seen.pixel[rows]] = part
    return image


def trace_direct(job: PixelJob, *, samples: int) -> Array:
    """Return the irradiance of all direct lights, float32 (H, W, 4); of an only one over its emission, (H, W, 1).

    samples: see `trace_light`.
    """
    lights, (width, height) = job.tracer.scene.direct_lights, job.size
    total = DirectSum(len(lights), width * height)
    for number, light in enumerate(lights):
        if any(light.emission):
            own = replace(job, seed=streams.frame_seed(job.seed, number))
            total.add(light, trace_light(own, light, samples=samples))
    return total.image.reshape(height, width, -1)


class DirectSum:
    """Adds up the irradiance of `lights` direct lights at `pixels`; that of an only one over its emission."""

    def __init__(self, lights: int, pixels: int) -> None:
        self._only = lights <= 1
        self.image: Array = np.zeros((pixels, 1 if self._only else 4), np.float32)

    def add(self, light: Light, strength: Array) -> None:
        """Add a light's irradiance over its emission, float32 (pixels,)."""
        if self._only:
            self.image[:, 0] = strength
        else:
            self.image[:, :3] += np.multiply.outer(strength, np.asarray(light.emission, np.float32))


def _spiral(places: Array, i: int, count: int) -> Array:
    """Return point i of `count` points spread over the unit disc, for each row of `places` (n, 2) in [0, 1), (n, 2).

    The points form Vogel's spiral, rotated by the first coordinate; the second says where in its ring of equal area a
    point lies, so that evenly spread places give evenly spread points.
    """
    radius = np.sqrt((i + places[:, 1]) / count)
    angle = 2 * np.pi * places[:, 0] + i * GOLDEN_ANGLE
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)


def irradiate(light: Light, tracer: Tracer, at: Hits | Surfaces, places: Array | None) -> Array:
    """Return irradiance over emission on n surfaces, shadows included, float64 (n, 1), or (n, 3) if its colours vary.

    places: of the unit disc, (n, 2), for a light that has an area.
    """
    found = light.sample(at.position, places, tracer.scene.bounds)
    facing = _dot(found.to, at.normal) > 0
    cosines = np.maximum(_dot(found.to, at.shading_normal), 0) * facing
    strength: Array = cosines[:, None] * (found.strength if found.strength.ndim > 1 else found.strength[:, None])
    lit = np.flatnonzero(strength.any(axis=1))
    starts = tracer.lift(at.position[lit], at.normal[lit])
    strength[lit[tracer.occluded(starts, found.ends[lit])]] = 0
    return strength


def _dot(a: Array, b: Array) -> Array:
    products: Array = np.einsum("ij,ij->i", a, b)
    return products
