"""All light that reaches surfaces straight from emitters, for the path tracer.

Emitters are sampled at a point each (next-event estimation). Those that rays of bounces may meet are sampled both ways,
and the balance heuristic weighs the two (Veach and Guibas 1995). Of many lights one is chosen, in proportion to power.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from deferred_ir.base.arrays import Array
from deferred_ir.rays.tracer import Hits, Tracer
from deferred_ir.scene.scene import Scene
from deferred_ir.truth.emitters.base import TINY, Emitter, Surroundings, dot
from deferred_ir.truth.emitters.surfaces import EmittingSurfaces

MOST_EACH = 8
"""Most lights that are all sampled at each vertex; of more, one is chosen."""
ALIKE = 0.1
"""Part of a choice that goes to all lights alike: a strong one may be far, or behind a wall."""
GOLDEN = (np.sqrt(5) - 1) / 2
"""The golden ratio, as the step of a lattice in the unit square."""


class Lighting:
    """What shines in the scene of `tracer`.

    met: emitters that rays of bounces may meet. varies: whether its estimates of direct light depend on chance.
    """

    def __init__(self, tracer: Tracer) -> None:
        self._tracer = tracer
        emitters = _find_emitters(tracer.scene)
        lights = [emitter for emitter in emitters if not emitter.is_seen]
        self._chosen = lights if len(lights) > MOST_EACH else []
        self._each = [emitter for emitter in emitters if emitter.is_seen or not self._chosen]
        self._seen = [emitter for emitter in emitters if emitter.is_seen]
        self.met = [emitter for emitter in self._each if emitter.can_be_met]
        self.varies = bool(self._chosen) or any(emitter.spreads for emitter in self._each)
        powers = np.array([emitter.power for emitter in self._chosen])
        if self._chosen:
            self._chances = (1 - ALIKE) * powers / powers.sum() + ALIKE / len(powers)

    def sample_well(self, at: Hits, count: int, rng: np.random.Generator) -> Array:
        """Return the irradiance on surfaces, (n, 3), the mean over `count` points of emitters spread evenly."""
        total = np.zeros((len(at.face), 3))
        repeated = None
        for emitter in self._each:
            if not emitter.spreads:
                total += self._irradiate(emitter, at, np.zeros((len(at.face), 2)))
                continue
            points = make_lattices(len(at.face), count, rng)
            repeated = repeated or at.rows(np.repeat(np.arange(len(at.face)), count))
            total += self._irradiate(emitter, repeated, points).reshape(-1, count, 3).mean(axis=1)
        if self._chosen:
            points = make_lattices(len(at.face), count, rng)
            repeated = repeated or at.rows(np.repeat(np.arange(len(at.face)), count))
            total += self._irradiate_by_choice(repeated, points).reshape(-1, count, 3).mean(axis=1)
        return total

    def sample(self, at: Hits, rng: np.random.Generator) -> Array:
        """Return the irradiance on surfaces, (n, 3), by a random point of each emitter."""
        total = np.zeros((len(at.face), 3))
        for emitter in self._each:
            total += self._irradiate(emitter, at, rng.random((len(at.face), 2)))
        if self._chosen:
            total += self._irradiate_by_choice(at, rng.random((len(at.face), 2)))
        return total

    def meet(self, origins: Array, directions: Array, cosines: Array, found: Hits) -> Array:
        """Return the radiance of emitters along cosine-distributed rays that hit `found`, weighted, (n, 3).

        directions: unit, (n, 3); cosines: with the shading normals that they are distributed about, (n,).
        """
        total = np.zeros((len(origins), 3))
        for emitter in self.met:
            radiance, density = emitter.meet(origins, directions, found)
            # What next-event estimation cannot sample is left to it all the same: it has no light.
            share = weigh_bounce(density, cosines / np.pi)
            total += _colour(radiance, share, emitter)
        return total

    def see(self, origin: Array, directions: Array, found: Hits) -> Array:
        """Return the radiance that the camera at `origin` (3,) sees straight from emitters, (n, 3)."""
        total = np.zeros((len(directions), 3))
        if self._seen:
            unit = directions / np.linalg.norm(directions, axis=1, keepdims=True)
            for emitter in self._seen:
                radiance, _ = emitter.meet(np.broadcast_to(origin, unit.shape), unit, found)
                total += _colour(radiance, np.ones(len(unit)), emitter)
        return total

    def _irradiate(self, emitter: Emitter, at: Hits, points: Array) -> Array:
        """Return the irradiance on surfaces, (n, 3), from points of an emitter, (n, 2) in the unit square."""
        ends, irradiance = self._find_unshadowed(emitter, at, points)
        return self._cast_shadows(at, ends, irradiance)

    def _irradiate_by_choice(self, at: Hits, points: Array) -> Array:
        """Return the irradiance from a point of one light for each surface; first coordinates also say of which."""
        stops = np.cumsum(self._chances)
        which = np.minimum(np.searchsorted(stops, points[:, 0], side="right"), len(stops) - 1)
        rest = np.clip((points[:, 0] - (stops - self._chances)[which]) / self._chances[which], 0, 1)
        ends, irradiance = np.zeros((len(points), 3)), np.zeros((len(points), 3))
        order = np.argsort(which, kind="stable")
        bounds = np.searchsorted(which[order], np.arange(len(stops) + 1))
        for number in np.flatnonzero(np.diff(bounds)):
            rows = order[bounds[number] : bounds[number + 1]]
            part = np.stack([rest[rows], points[rows, 1]], axis=1)
            found = self._find_unshadowed(self._chosen[number], at.rows(rows), part)
            ends[rows], irradiance[rows] = found[0], found[1] / self._chances[number]
        return self._cast_shadows(at, ends, irradiance)

    def _find_unshadowed(self, emitter: Emitter, at: Hits, points: Array) -> tuple[Array, Array]:
        """Return where shadow rays end, (n, 3), and the irradiance (n, 3) if they meet nothing."""
        found = emitter.sample(at.position, points)
        faces = dot(found.to, at.normal) > 0
        cosines = np.where(faces, np.maximum(dot(found.to, at.shading_normal), 0), 0)
        if emitter in self.met:
            cosines *= weigh_light(found.over, cosines / np.pi)
        if found.strength.ndim > 1:
            return found.ends, found.strength * (cosines / found.over)[:, None] * emitter.emission
        return found.ends, np.multiply.outer(found.strength * cosines / found.over, emitter.emission)

    def _cast_shadows(self, at: Hits, ends: Array, irradiance: Array) -> Array:
        """Return `irradiance` (n, 3), 0 where something lies on the way to `ends` (n, 3)."""
        red, green, blue = irradiance.T
        lit = np.flatnonzero((red > 0) | (green > 0) | (blue > 0))
        hidden = self._tracer.occluded(self._tracer.lift(at.position[lit], at.normal[lit]), ends[lit])
        irradiance[lit[hidden]] = 0
        return irradiance


def weigh_light(density: Array, other: Array) -> Array:
    """Return the weight of samples of an emitter, drawn with `density`, which bounces draw with density `other`."""
    weights: Array = density / (density + other)
    return weights


def weigh_bounce(other: Array, density: Array) -> Array:
    """Return the weight of rays of bounces, drawn with `density`, which samples draw with density `other`."""
    weights: Array = density / np.maximum(density + other, TINY)
    return weights


def make_lattices(sets: int, count: int, rng: np.random.Generator) -> Array:
    """Return `sets` lattices of `count` points of the unit square, (sets * count, 2).

    Each is a golden-section lattice, moved by a random vector of its own (Cranley and Patterson 1976): uniform for any
    count, and far better spread than random points.
    """
    i = np.arange(count)
    lattice = np.stack([i / count, i * GOLDEN % 1], axis=1)
    return ((lattice + rng.random((sets, 1, 2))) % 1).reshape(-1, 2)


def _colour(radiance: Array, factors: Array, emitter: Emitter) -> Array:
    """Return radiance (n,) or (n, 3) over emission, times `factors` (n,), in colour, (n, 3)."""
    if radiance.ndim > 1:
        return radiance * factors[:, None] * emitter.emission
    return np.multiply.outer(radiance * factors, emitter.emission)


def _find_emitters(scene: Scene) -> list[Emitter]:
    """Return the lights of a scene that are on, and its emitting surfaces."""
    low, high = scene.geometry.bounds
    around = Surroundings((low + high) / 2, max(float(np.linalg.norm(high - low)) / 2, TINY))
    emitters: list[Emitter] = [_find_twin(light.kind)(light, around) for light in scene.lights]
    if any(any(material.emission) for material in scene.materials):
        emitters.append(EmittingSurfaces(scene))
    return [emitter for emitter in emitters if emitter.power > 0]


@cache
def _find_twin(kind: str) -> Callable[[Any, Surroundings], Emitter]:
    """Return the twin of a kind of light, from the file of that name."""
    twin: Callable[[Any, Surroundings], Emitter] = importlib.import_module(f"deferred_ir.truth.emitters.{kind}").TWIN
    return twin
