"""Trace paths under the light model of docs/conventions.md: the judge of images by VPLs and by the rasteriser.

So that no fault can hide in both, it shares only ray queries and the camera with them, and has samples and a formula of
the spotlight of its own. Camera rays go through the centres of pixels, without a pixel filter. Direct light is sampled
at each vertex of a path (next-event estimation); bounces are cosine-distributed about the shading normal.
"""

from __future__ import annotations

from contextlib import closing
from dataclasses import dataclass, field

import numpy as np

from deferred_ir.base.arrays import Array, Bools, Ints
from deferred_ir.base.parallel import run_in_order
from deferred_ir.base.progress import Progress
from deferred_ir.rays.tracer import Hits, Tracer
from deferred_ir.scene.scene import Scene

MOST_BATCHES = 16
"""Most batches into which the paths of a pixel are divided, to know their variance."""
RAYS = 1 << 13
"""Rays of a task: few enough for their arrays to stay in a core's cache."""
GOLDEN = (np.sqrt(5) - 1) / 2
"""The golden ratio, as the step of a lattice in the unit square."""


@dataclass(frozen=True, eq=False)
class Estimate:
    """Estimated radiance, float64 (H, W, 3), top row first as in image files; 0 where the camera ray hits nothing.

    hit: where it hits something, bool (H, W). variance: that of each value of direct + indirect, float64 (H, W, 3), all
    independent between pixels; None for a single sample a pixel, which cannot tell it.
    """

    direct: Array
    indirect: Array
    hit: Bools
    variance: Array | None


@dataclass(frozen=True, eq=False)
class PathTracer:
    """A path tracer with up to `bounces` indirect bounces.

    clamp, fov: for comparisons only. They attenuate the light of a path's first bounce as VPLs do: by
    min(1, d^2 / (clamp * diagonal)^2), and to 0 outside a cone of `fov` degrees about the normal where it leaves. VPLs
    with the same clamp and cone converge to this; 0 and 180 attenuate nothing.
    """

    scene: Scene
    tracer: Tracer
    bounces: int = 1
    clamp: float = 0.0
    fov: float = 180.0
    _axes: Array = field(init=False)

    def __post_init__(self) -> None:
        """Set the rows of `_axes`: the spotlight's axis and two directions that span its disc."""
        light = self.scene.spotlight
        axis = np.subtract(light.look_at, light.position).astype(np.float64)
        axis /= np.linalg.norm(axis)
        right = np.cross(axis, np.eye(3)[np.abs(axis).argmin()])
        right /= np.linalg.norm(right)
        object.__setattr__(self, "_axes", np.stack([axis, right, np.cross(axis, right)]))

    def trace_camera_rays(self, size: tuple[int, int]) -> Hits:
        """Return the hits behind the centres of all pixels, row by row, top row first."""
        directions = self.scene.camera.rays(size).reshape(-1, 3)
        origins = np.broadcast_to(np.asarray(self.scene.camera.position, float), directions.shape)
        return self.tracer.closest(origins, directions)

    def estimate_direct(self, size: tuple[int, int], spp: int, seed: int = 0, threads: int | None = None) -> Array:
        """Return direct light alone, float64 (H, W, 3): exact for a point light, by `spp` points of a disc light."""
        alone = PathTracer(self.scene, self.tracer, bounces=0)
        return alone.estimate(size, spp, seed, threads).direct

    def estimate(
        self,
        size: tuple[int, int],
        spp: int,
        seed: int = 0,
        threads: int | None = None,
        progress: Progress | None = None,
    ) -> Estimate:
        """Estimate an image of `size` (width, height) by `spp` paths a pixel.

        The paths of a pixel are traced in batches, stratified within and independent of each other, whose spread gives
        the variance. The result does not depend on the number of `threads`. progress: called with the tasks done and
        all there are.
        """
        seen = self.trace_camera_rays(size)
        pixels = np.flatnonzero(seen.hit)
        noisy = self.bounces > 0 or self.scene.spotlight.radius > 0
        counts = _split_batches(spp) if noisy else [1]
        per_task = max(1, RAYS // max(counts))
        tasks = [
            (number, batch, pixels[start : start + per_task])
            for number, start in enumerate(range(0, len(pixels), per_task))
            for batch in range(len(counts))
        ]

        def work(task: tuple[int, int, Ints]) -> tuple[Array, Array]:
            number, batch, chosen = task
            rng = np.random.default_rng([seed, number, batch])
            surfaces = seen.rows(chosen)
            direct = self._estimate_direct(surfaces, counts[batch], rng)
            return direct, self._estimate_indirect(surfaces, counts[batch], rng)

        direct, indirect, mean, squares = (np.zeros((len(seen.face), 3)) for _ in range(4))
        with closing(run_in_order(work, tasks, threads)) as results:
            for done, ((_, batch, chosen), (near, far)) in enumerate(zip(tasks, results, strict=True), start=1):
                direct[chosen] += near * (counts[batch] / sum(counts))
                indirect[chosen] += far * (counts[batch] / sum(counts))
                # Welford's update: sums of squares would cancel where the spread is small.
                off = near + far - mean[chosen]
                mean[chosen] += off / (batch + 1)
                squares[chosen] += off * (near + far - mean[chosen])
                if progress:
                    progress(done, len(tasks))
        shape = (size[1], size[0])
        variance = squares / (max(len(counts) - 1, 1) * len(counts)) if len(counts) > 1 or not noisy else None
        return Estimate(
            direct.reshape(*shape, 3),
            indirect.reshape(*shape, 3),
            seen.hit.reshape(shape),
            None if variance is None else variance.reshape(*shape, 3),
        )

    def _estimate_direct(self, surfaces: Hits, count: int, rng: np.random.Generator) -> Array:
        """Return the radiance of direct light, (n, 3), the mean over `count` points of a disc light."""
        if self.scene.spotlight.radius == 0:
            arriving = self._trace_irradiance(surfaces, np.zeros((len(surfaces.face), 2)))
        else:
            points = _make_lattices(len(surfaces.face), count, rng)
            repeated = surfaces.rows(np.repeat(np.arange(len(surfaces.face)), count))
            arriving = self._trace_irradiance(repeated, points).reshape(-1, count, 3).mean(axis=1)
        radiance: Array = surfaces.albedo / np.pi * arriving
        return radiance

    def _estimate_indirect(self, surfaces: Hits, count: int, rng: np.random.Generator) -> Array:
        """Return the radiance after 1 to `bounces` bounces, (n, 3), the mean of `count` paths for each surface."""
        paths = np.arange(len(surfaces.face) * count)
        total = np.zeros((len(paths), 3))
        at = surfaces.rows(paths // count)
        weight = at.albedo
        for bounce in range(self.bounces):
            if len(paths) == 0:
                break
            points = rng.random((len(paths), 2)) if bounce else _make_lattices(len(surfaces.face), count, rng)
            # A unit normal plus a point of the unit sphere is cosine-distributed; its length does not matter.
            directions = at.shading_normal + _map_to_sphere(points)
            up = np.flatnonzero(_dot(directions, at.normal) > 0)
            found = self.tracer.closest(self.tracer.lift(at.position[up], at.normal[up]), directions[up])
            landed = np.flatnonzero(found.hit)
            rows = up[landed]
            start, at = at.position[rows], found.rows(landed)
            paths, weight = paths[rows], weight[rows] * at.albedo
            if bounce == 0:
                weight *= self._attenuate_as_vpls(start - at.position, at.normal)[:, None]
            total[paths] += weight / np.pi * self._trace_irradiance(at, rng.random((len(paths), 2)))
        mean: Array = total.reshape(-1, count, 3).mean(axis=1)
        return mean

    def _attenuate_as_vpls(self, ways: Array, normals: Array) -> Array:
        """Return the fraction that clamp and cone leave of light along `ways` from surfaces with `normals`, (n,)."""
        square = _dot(ways, ways)
        cosine = _dot(ways, normals) / np.sqrt(np.maximum(square, 1e-300))
        clamp = (self.clamp * self.scene.geometry.diagonal) ** 2
        left: Array = np.minimum(square / clamp, 1) if clamp > 0 else np.ones(len(ways))
        if self.fov < 180:
            left[cosine < np.cos(np.radians(self.fov) / 2)] = 0
        return left

    def _trace_irradiance(self, at: Hits, points: Array) -> Array:
        """Return irradiance on surfaces, (n, 3), from points of the spotlight's disc, (n, 2) in the unit square."""
        light = self.scene.spotlight
        axis, right, up = self._axes
        angle, radius = 2 * np.pi * points[:, 1:], light.radius * np.sqrt(points[:, :1])
        source = np.asarray(light.position) + radius * (np.cos(angle) * right + np.sin(angle) * up)
        to = source - at.position
        distance = np.maximum(np.sqrt(_dot(to, to)), 1e-150)
        to /= distance[:, None]
        # 1 - cos of angle and cone by squares of half angles: differences would cancel for the narrowest cones.
        off_axis, edge = _dot(to + axis, to + axis) / 2, 2 * np.sin(np.radians(light.fov) / 4) ** 2
        cone = np.clip(4 * (edge - off_axis) / edge, 0, 1)
        faces = _dot(to, at.normal) > 0
        arriving = np.where(faces, np.maximum(_dot(to, at.shading_normal), 0), 0)
        power = np.maximum(-(to @ axis), 0) * cone * arriving / distance**2
        lit = np.flatnonzero(power > 0)
        hidden = self.tracer.occluded(self.tracer.lift(at.position[lit], at.normal[lit]), source[lit])
        power[lit[hidden]] = 0
        arriving_rgb: Array = np.multiply.outer(power, np.asarray(light.emission, float))
        return arriving_rgb


def _split_batches(spp: int) -> list[int]:
    """Return the paths a pixel in each batch: about as many batches as paths in each, for both spread and strata."""
    batches = int(min(np.sqrt(spp), MOST_BATCHES))
    batches = min(max(batches, 2), spp)
    return [spp * (i + 1) // batches - spp * i // batches for i in range(batches)]


def _dot(a: Array, b: Array) -> Array:
    """Return the dot products of rows (n, 3), (n,)."""
    products: Array = np.einsum("ij,ij->i", a, b)
    return products


def _make_lattices(sets: int, count: int, rng: np.random.Generator) -> Array:
    """Return `sets` lattices of `count` points of the unit square, (sets * count, 2).

    Each is a golden-section lattice, moved by a random vector of its own (Cranley and Patterson 1976): uniform for any
    count, and far better spread than random points.
    """
    i = np.arange(count)
    lattice = np.stack([i / count, i * GOLDEN % 1], axis=1)
    return ((lattice + rng.random((sets, 1, 2))) % 1).reshape(-1, 2)


def _map_to_sphere(points: Array) -> Array:
    """Map points of the unit square (n, 2) to the unit sphere (n, 3), preserving area (Archimedes)."""
    height, angle = 1 - 2 * points[:, 0], 2 * np.pi * points[:, 1]
    radius = np.sqrt(np.maximum(1 - height**2, 0))
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=1)
