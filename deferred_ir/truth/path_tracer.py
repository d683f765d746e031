"""Trace paths under the light model of docs/conventions.md: the judge of images by VPLs and by the rasteriser.

So that no fault can hide in both, it shares only ray queries and the camera with them, and has samples and formulas of
all kinds of light of its own (`emitters`). Camera rays go through the centres of pixels, without a pixel filter. Direct
light is sampled at each vertex of a path (`lighting`); bounces are cosine-distributed about the shading normal.

What the camera sees reflects by the whole BRDF (`reflection`): its diffuse part begins bounces, and its glossy part a
path that shows what it meets as the camera would see it, with direct light, bounces and further reflections, up to
MOST_REFLECTIONS. Bounces are diffuse, and direct light at their ends is reflected diffusely: caustics, light that gloss
casts on surfaces, are left out.
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
from deferred_ir.truth.emitters.base import TINY, dot
from deferred_ir.truth.lighting import Lighting, make_lattices
from deferred_ir.truth.reflection import Receivers, normalize

MOST_BATCHES = 16
"""Most batches into which the paths of a pixel are divided, to know their variance."""
RAYS = 1 << 13
"""Rays of a task: few enough for their arrays to stay in a core's cache."""

MOST_REFLECTIONS = 32
"""Most glossy reflections that the camera sees one in another; further ones are black. White metals alone need many."""
ROULETTE = 0.25
"""Paths by reflections that weigh less go on by chance, and then weigh this much."""


@dataclass(frozen=True, eq=False)
class Estimate:
    """Estimated radiance, float64 (H, W, 3), top row first as in image files.

    direct: light that comes to what the camera sees straight from an emitter; indirect: after bounces, or reflected by
    gloss as other surfaces show it; both are 0 where the camera ray hits nothing. emission: what the camera sees
    shining itself, the environment behind all included.
    hit: where the ray hits something, bool (H, W). variance: that of each value of direct + indirect, float64
    (H, W, 3), all independent between pixels; None for a single sample a pixel, which cannot tell it.
    """

    direct: Array
    indirect: Array
    emission: Array
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
    _lighting: Lighting = field(init=False)

    def __post_init__(self) -> None:
        """Find what shines."""
        object.__setattr__(self, "_lighting", Lighting(self.tracer))

    def trace_camera_rays(self, size: tuple[int, int]) -> Hits:
        """Return the hits behind the centres of all pixels, row by row, top row first."""
        directions = self._directions(size)
        origins = np.broadcast_to(np.asarray(self.scene.camera.position, float), directions.shape)
        return self.tracer.closest(origins, directions)

    def _directions(self, size: tuple[int, int]) -> Array:
        """Return the directions through all pixels, (n, 3), not unit."""
        return self.scene.camera.rays(size).reshape(-1, 3)

    def find_emission(self, size: tuple[int, int], seen: Hits) -> Array:
        """Return the radiance of emitters that the camera sees, (n, 3), where its rays hit `seen`."""
        return self._lighting.see(np.asarray(self.scene.camera.position, float), self._directions(size), seen)

    def estimate_direct(self, size: tuple[int, int], spp: int, seed: int = 0, threads: int | None = None) -> Array:
        """Return direct light alone, float64 (H, W, 3): exact for points, by `spp` samples of what has an area."""
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
        directions = self._directions(size)
        pixels = np.flatnonzero(seen.hit)
        noisy = self.bounces > 0 or self._lighting.varies or seen.gloss is not None
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
            at = Receivers.make(surfaces, directions[chosen], show_gloss=True)
            direct = self._lighting.sample_well(at, counts[batch], rng).leave(surfaces.albedo)
            met, indirect = self._follow_bounces(at, counts[batch], rng)
            rows = at.find_shiny()
            if len(rows):
                shone, reflected = self._follow_reflections(at.rows(rows), counts[batch], rng)
                direct[rows] += shone
                indirect[rows] += reflected
            return direct + met, indirect

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
            self.find_emission(size, seen).reshape(*shape, 3),
            seen.hit.reshape(shape),
            None if variance is None else variance.reshape(*shape, 3),
        )

    def _follow_bounces(self, at: Receivers, count: int, rng: np.random.Generator) -> tuple[Array, Array]:
        """Follow `count` paths that leave each surface diffusely. Returns two radiances, (n, 3) each, means over paths.

        The first is that of emitters that the first ray of a path meets: a part of direct light. The second is light
        after 1 to `bounces` bounces.
        """
        surfaces = len(at.hits.face)
        paths = np.arange(surfaces * count)
        met, total = np.zeros((len(paths), 3)), np.zeros((len(paths), 3))
        at = at.rows(paths // count)
        weight = at.hits.albedo
        # The last rays only look for emitters.
        for bounce in range(self.bounces + bool(self._lighting.met)):
            if len(paths) == 0:
                break
            points = rng.random((len(paths), 2)) if bounce else make_lattices(surfaces, count, rng)
            # A unit normal plus a point of the unit sphere is cosine-distributed; its length does not matter.
            directions = at.hits.shading_normal + _map_to_sphere(points)
            if at.to_viewer is not None:
                weight = weight * at.keep(normalize(directions))[:, None]
            up = np.flatnonzero(dot(directions, at.hits.normal) > 0)
            origins = self.tracer.lift(at.hits.position[up], at.hits.normal[up])
            found = self.tracer.closest(origins, directions[up])
            if self._lighting.met:
                unit = directions[up] / np.linalg.norm(directions[up], axis=1, keepdims=True)
                radiance = self._lighting.meet(origins, unit, dot(unit, at.hits.shading_normal[up]), found)
                (total if bounce else met)[paths[up]] += weight[up] * radiance
            if bounce == self.bounces:
                break
            landed = np.flatnonzero(found.hit)
            rows = up[landed]
            start = at.hits.position[rows]
            at = Receivers.make(found.rows(landed), directions[rows], show_gloss=False)
            paths, weight = paths[rows], weight[rows] * at.hits.albedo
            if bounce == 0:
                weight *= self._attenuate_as_vpls(start - at.hits.position, at.hits.normal)[:, None]
            total[paths] += weight / np.pi * self._lighting.sample(at, rng).irradiance
        return met.reshape(-1, count, 3).mean(axis=1), total.reshape(-1, count, 3).mean(axis=1)

    def _follow_reflections(self, at: Receivers, count: int, rng: np.random.Generator) -> tuple[Array, Array]:
        """Follow `count` glossy reflections of each surface. Returns two radiances, (n, 3) each, means over paths.

        The first is that of emitters that the first ray of a path meets: a part of direct light. The second is that of
        what reflections show, further ones and bounces included.
        """
        surfaces = len(at.hits.face)
        paths = np.arange(surfaces * count)
        met, total = np.zeros((len(paths), 3)), np.zeros((len(paths), 3))
        points = make_lattices(surfaces, count, rng)
        at, weight = at.rows(paths // count), np.ones((len(paths), 3))
        for reflection in range(MOST_REFLECTIONS):
            directions = at.draw(points)
            density = at.find_density(directions)
            cosine = np.maximum(dot(directions, at.hits.shading_normal), 0)
            weight = weight * at.reflect(directions) * (cosine / np.maximum(density, TINY))[:, None]
            up = np.flatnonzero((dot(directions, at.hits.normal) > 0) & weight.any(axis=1))
            origins = self.tracer.lift(at.hits.position[up], at.hits.normal[up])
            found = self.tracer.closest(origins, directions[up])
            radiance = self._lighting.meet_by_gloss(origins, directions[up], density[up], found)
            (total if reflection else met)[paths[up]] += weight[up] * radiance
            chance = np.minimum(weight[up].max(axis=1) / ROULETTE, 1)
            going = np.flatnonzero(found.hit & (rng.random(len(up)) < chance))
            if len(going) == 0:
                break
            rows = up[going]
            at = Receivers.make(found.rows(going), directions[rows], show_gloss=True)
            paths, weight = paths[rows], weight[rows] / chance[going, None]
            shown = self._lighting.sample(at, rng).leave(at.hits.albedo)
            for part in self._follow_bounces(at, 1, rng):
                shown += part
            total[paths] += weight * shown
            points = rng.random((len(paths), 2))
        return met.reshape(-1, count, 3).mean(axis=1), total.reshape(-1, count, 3).mean(axis=1)

    def _attenuate_as_vpls(self, ways: Array, normals: Array) -> Array:
        """Return the fraction that clamp and cone leave of light along `ways` from surfaces with `normals`, (n,)."""
        square = dot(ways, ways)
        cosine = dot(ways, normals) / np.sqrt(np.maximum(square, 1e-300))
        clamp = (self.clamp * self.scene.geometry.diagonal) ** 2
        left: Array = np.minimum(square / clamp, 1) if clamp > 0 else np.ones(len(ways))
        if self.fov < 180:
            left[cosine < np.cos(np.radians(self.fov) / 2)] = 0
        return left


def _split_batches(spp: int) -> list[int]:
    """Return the paths a pixel in each batch: about as many batches as paths in each, for both spread and strata."""
    batches = int(min(np.sqrt(spp), MOST_BATCHES))
    batches = min(max(batches, 2), spp)
    return [spp * (i + 1) // batches - spp * i // batches for i in range(batches)]


def _map_to_sphere(points: Array) -> Array:
    """Map points of the unit square (n, 2) to the unit sphere (n, 3), preserving area (Archimedes)."""
    height, angle = 1 - 2 * points[:, 0], 2 * np.pi * points[:, 1]
    radius = np.sqrt(np.maximum(1 - height**2, 0))
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=1)
