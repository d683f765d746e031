"""What glossy surfaces reflect, by rays: of each surface a few, in directions of its lobe.

A ray shows its hit as the camera would see it, with direct light and that of VPLs; from a glossy hit it goes on. Lights
with an area are reflected both ways, where rays meet them and by places drawn on them, weighed by the balance heuristic
(Veach and Guibas 1995): a mirror shows a small light by the one, a rough surface finds it by the other.
"""

from __future__ import annotations

from contextlib import closing
from dataclasses import dataclass, replace

import numpy as np

from deferred_ir.base.arrays import Array, Ints
from deferred_ir.base.colour import LUMINANCE
from deferred_ir.base.parallel import run_in_order
from deferred_ir.pool.traced_pixels import WIDE
from deferred_ir.pool.vpl_choice import VplChoice
from deferred_ir.rays.pixel_surfaces import Surfaces
from deferred_ir.rays.tracer import Hits, Tracer
from deferred_ir.sampling import streams
from deferred_ir.sampling.warps import square_to_disc
from deferred_ir.scene.lights.base import Light, is_sampled
from deferred_ir.scene.surfaces import brdf
from deferred_ir.scene.surfaces.brdf import Gloss

PIXELS = 1 << 12
"""Pixels of a task: few enough for their arrays to stay in a core's cache."""
MOST_REFLECTIONS = 4
"""Surfaces that a ray meets at most; only glossy ones send it on."""
TIMES = 4
"""Where rays of narrower lobes first hit, light is drawn so many times: the filter finds little to average there."""
LEAST_SHARE = 0.02
"""Reflectances below this are taken as this where light is carried over its reflectance."""


@dataclass(frozen=True, eq=False)
class GlossyPixels:
    """Glossy surfaces behind n pixels. to_viewer: unit, (n, 3)."""

    seen: Surfaces
    gloss: Gloss
    to_viewer: Array

    def rows(self, chosen: Ints | slice) -> GlossyPixels:
        """Return the pixels `chosen`."""
        return GlossyPixels(self.seen.rows(chosen), self.gloss.rows(chosen), self.to_viewer[chosen])


@dataclass(frozen=True, eq=False)
class _Surface:
    """Surfaces that reflect: positions, geometric and shading normals, (n, 3), gloss, and unit ways to the viewer."""

    position: Array
    normal: Array
    shading_normal: Array
    gloss: Gloss
    to_viewer: Array


@dataclass(frozen=True, eq=False)
class _Rays:
    """Rays of lobes: starts and unit ways, (n, 3), BRDF times cosine over density, (n, 3), and density, (n,)."""

    starts: Array
    ways: Array
    weights: Array
    density: Array

    def rows(self, chosen: Ints) -> _Rays:
        return _Rays(self.starts[chosen], self.ways[chosen], self.weights[chosen], self.density[chosen])


def _draw_rays(tracer: Tracer, surface: _Surface, points: Array) -> tuple[Ints, _Rays]:
    """Draw a ray of each surface's lobe. Returns the rows of those that leave their surface, and their rays."""
    ways, weights = brdf.sample(surface.gloss, surface.shading_normal, surface.to_viewer, points)
    rows = np.flatnonzero((np.einsum("ij,ij->i", ways, surface.normal) > 0) & weights.any(axis=1))
    lobes = surface.gloss.rows(rows), surface.shading_normal[rows], surface.to_viewer[rows]
    starts = tracer.lift(surface.position[rows], surface.normal[rows])
    return rows, _Rays(starts, ways[rows], weights[rows], brdf.pdf(*lobes, ways[rows]))


@dataclass(frozen=True, eq=False)
class Reflections:
    """Rays from glossy surfaces. all_direct: direct lights are reflected, too, which a shader does otherwise."""

    tracer: Tracer
    vpls: VplChoice
    all_direct: bool

    def trace(self, pixels: GlossyPixels, count: int, seed: int) -> tuple[Array, Array]:
        """Return reflected radiance over `share_reflectance`, (n, 3), and the distance to what is reflected, (n,).

        count: rays a pixel. Both are means over the rays; distances are harmonic, infinite where nothing is near.
        """
        total = len(pixels.seen.pixel)
        image, near = np.zeros((total, 3)), np.zeros(total)
        tasks = [(i, slice(start, start + PIXELS)) for i, start in enumerate(range(0, total, PIXELS))]

        def work(task: tuple[int, slice]) -> tuple[Array, Array]:
            number, rows = task
            return self._trace_task(pixels.rows(rows), count, streams.reflections(seed, number))

        with closing(run_in_order(work, tasks)) as results:
            for (_, rows), (radiance, inverse) in zip(tasks, results, strict=True):
                image[rows], near[rows] = radiance, inverse
        return image, 1 / np.maximum(near, np.finfo(float).tiny)

    def _trace_task(self, pixels: GlossyPixels, count: int, rng: np.random.Generator) -> tuple[Array, Array]:
        own = len(pixels.seen.pixel)
        each = pixels.rows(np.repeat(np.arange(own), count)) if count > 1 else pixels
        normal = each.seen.shading_normal.astype(np.float64)
        radiance = self._reflect_lights(each.seen, each.gloss, each.to_viewer, rng)[1]
        points = rng.random((own, count, 2))
        points[..., 0] = (points[..., 0] + np.arange(count)) / count
        position = each.seen.position.astype(np.float64)
        surface = _Surface(position, each.seen.normal, normal, each.gloss, each.to_viewer)
        above, rays = _draw_rays(self.tracer, surface, points.reshape(-1, 2))
        shown, inverse = self._follow(rays, each.gloss.alpha[above], rng)
        radiance[above] += shown
        radiance /= share_reflectance(each.gloss, normal, each.to_viewer)
        distances = np.zeros(len(radiance))
        distances[above] = inverse
        return radiance.reshape(own, count, 3).mean(axis=1), distances.reshape(own, count).mean(axis=1)

    def _follow(self, rays: _Rays, widest: Array, rng: np.random.Generator) -> tuple[Array, Array]:
        """Return what rays (n) show, times their weights, (n, 3), and 1 over the distance of their first hits, (n,).

        widest: widths of the lobes that they come from.
        """
        narrow = widest <= WIDE
        shown, inverse = np.zeros(rays.starts.shape), np.zeros(len(rays.starts))
        rows = np.arange(len(shown))
        for number in range(MOST_REFLECTIONS):
            found = self.tracer.closest(rays.starts, rays.ways)
            distance = np.linalg.norm(found.position - rays.starts, axis=1)
            if number == 0:
                inverse[found.hit] = 1 / np.maximum(distance[found.hit], np.finfo(float).tiny)
            shown[rows] += rays.weights * self._see(rays, found, distance)
            hit = np.flatnonzero(found.hit)
            if not len(hit):
                break
            rows, at, weights, viewer = rows[hit], found.rows(hit), rays.weights[hit], -rays.ways[hit]
            assert at.gloss is not None
            # What a wide lobe shows is blurred anyway; the highlights of narrow ones in it would be rare, bright dots
            # (Kaplanyan and Dachsbacher 2013, section 4).
            widest = np.maximum(at.gloss.alpha, widest[hit])
            gloss = replace(at.gloss, alpha=widest)
            times = np.where(narrow[rows] & (number == 0), TIMES, 1)
            shown[rows] += weights * self._shade(at, gloss, viewer, times, rng)
            surface = _Surface(at.position, at.normal, at.shading_normal, gloss, viewer)
            on, ahead = _draw_rays(self.tracer, surface, rng.random((len(rows), 2)))
            chance = np.clip(ahead.weights @ LUMINANCE, 0, 1)
            stay = np.flatnonzero(rng.random(len(on)) < chance)
            rays = ahead.rows(stay)
            rays = replace(rays, weights=rays.weights * weights[on[stay]] / chance[stay, None])
            rows, widest = rows[on[stay]], widest[on[stay]]
        return shown, inverse

    def _shade(self, at: Hits, gloss: Gloss, to_viewer: Array, times: Ints, rng: np.random.Generator) -> Array:
        """Return the radiance that hits (n) reflect towards the viewer, (n, 3), each a mean over `times` (n,) draws."""
        rows = np.repeat(np.arange(len(times)), times)
        part, lobe, viewer = at.rows(rows), gloss.rows(rows), to_viewer[rows]
        irradiance, glossy = self._reflect_lights(part, lobe, viewer, rng, direct=True)
        mean = brdf.find_mean_kept(lobe, np.abs(np.einsum("ij,ij->i", part.shading_normal, viewer)))
        irradiance += self.vpls.irradiate(part, rng) * mean[:, None]
        radiance = part.albedo / np.pi * irradiance + glossy
        summed = np.stack([np.bincount(rows, radiance[:, channel], len(times)) for channel in range(3)], axis=1)
        mean_radiance: Array = summed / times[:, None]
        return mean_radiance

    def _see(self, rays: _Rays, found: Hits, distance: Array) -> Array:
        """Return the radiance that shines itself along rays, (n, 3), weighed against places drawn on lights."""
        scene, reach = self.tracer.scene, np.where(found.hit, distance, np.inf)
        seen = self.tracer.find_emission(found, rays.ways)
        surfaces = scene.surface_light
        if surfaces is not None:
            rows = np.flatnonzero(seen.any(axis=1))
            other = surfaces.find_density(found.face[rows], rays.ways[rows], distance[rows])
            seen[rows] *= _weigh(rays.density[rows], other)[:, None]
        for light in scene.sampled_lights:
            met = light.meet(rays.starts, rays.ways)
            seen += met.radiance * (_weigh(rays.density, met.density) * (met.distance < reach))[:, None]
        return seen

    def _reflect_lights(
        self,
        at: Hits | Surfaces,
        gloss: Gloss,
        to_viewer: Array,
        rng: np.random.Generator,
        *,
        direct: bool = False,
    ) -> tuple[Array, Array]:
        """Return the irradiance that the diffuse part reflects, and glossy radiance, (n, 3) each, straight from lights.

        Places on lights with an area are drawn, and weighed against rays of the lobe. direct: direct lights count
        whatever `all_direct` says.
        """
        irradiance, glossy = np.zeros((len(to_viewer), 3)), np.zeros((len(to_viewer), 3))
        for light in self.tracer.scene.emitters:
            if direct or self.all_direct or is_sampled(light):
                part = self._reflect_light(light, at, gloss, to_viewer, rng)
                irradiance += part[0]
                glossy += part[1]
        return irradiance, glossy

    def _reflect_light(
        self, light: Light, at: Hits | Surfaces, gloss: Gloss, to_viewer: Array, rng: np.random.Generator
    ) -> tuple[Array, Array]:
        places = square_to_disc(rng.random((len(to_viewer), 2))) if light.has_area else None
        position = np.asarray(at.position, np.float64)
        found = light.sample(position, places, self.tracer.scene.bounds)
        normal = np.asarray(at.shading_normal, np.float64)
        facing = np.einsum("ij,ij->i", found.to, at.normal) > 0
        cosines = np.maximum(np.einsum("ij,ij->i", found.to, normal), 0) * facing
        strength = found.strength if found.strength.ndim > 1 else found.strength[:, None]
        arriving = np.asarray(light.emission) * strength * cosines[:, None]
        lit = np.flatnonzero(arriving.any(axis=1))
        starts = self.tracer.lift(position[lit], at.normal[lit])
        arriving[lit[self.tracer.occluded(starts, found.ends[lit])]] = 0
        kept, lobe = brdf.eval(gloss, normal, to_viewer, found.to)
        if found.density is not None:
            lobe *= _weigh(found.density, brdf.pdf(gloss, normal, to_viewer, found.to))[:, None]
        return arriving * kept[:, None], arriving * lobe


def _weigh(density: Array, other: Array) -> Array:
    """Return the weight of what was drawn with `density` where another way draws it with density `other`, (n,)."""
    finite = np.minimum(other, np.finfo(float).max / 4)
    weight: Array = np.minimum(density, np.finfo(float).max / 4)
    return weight / np.maximum(weight + finite, np.finfo(float).tiny)


def share_reflectance(gloss: Gloss, normal: Array, to_viewer: Array) -> Array:
    """Return about the share of light that gloss reflects, (n, 3), by which reflections are divided for filtering.

    As in shaders/lib/surface/brdf.glsl.
    """
    x = (1 - np.clip(np.abs(np.einsum("ij,ij->i", normal, to_viewer)), 0, 1)) ** 5
    share: Array = np.maximum(brdf.find_reflectance(gloss, x), LEAST_SHARE)
    return share
