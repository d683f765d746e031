"""All light that reaches surfaces straight from emitters, for the path tracer.

Emitters are sampled at a point each (next-event estimation). Those that rays of bounces may meet are sampled both ways,
and the balance heuristic weighs the two (Veach and Guibas 1995). Of many lights one is chosen, in proportion to power.
Where surfaces show their gloss, this is done for each part of the BRDF by itself: rays by the glossy part meet whatever
has an area.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from deferred_ir.base.arrays import Array, Ints
from deferred_ir.rays.tracer import Hits, Tracer
from deferred_ir.scene.scene import Scene
from deferred_ir.truth.emitters.base import TINY, Arriving, Emitter, Surroundings, dot
from deferred_ir.truth.emitters.surfaces import EmittingSurfaces
from deferred_ir.truth.reflection import Receivers

MOST_EACH = 8
"""Most lights that are all sampled at each vertex; of more, one is chosen."""
ALIKE = 0.1
"""Part of a choice that goes to all lights alike: a strong one may be far, or behind a wall."""
GOLDEN = (np.sqrt(5) - 1) / 2
"""The golden ratio, as the step of a lattice in the unit square."""


@dataclass(frozen=True, eq=False)
class Received:
    """Light on n surfaces.

    irradiance: on what reflects it diffusely, (n, 3). glossy: radiance that the glossy part reflects of it, (n, 3);
    None where that part does not count.
    """

    irradiance: Array
    glossy: Array | None

    @classmethod
    def none(cls, at: Receivers) -> Received:
        """Return darkness."""
        shape = at.hits.position.shape
        return cls(np.zeros(shape), np.zeros(shape) if at.shows_gloss else None)

    def add(self, other: Received, count: int = 1) -> None:
        """Add the means over each `count` rows of `other`."""
        for own, more in zip(self._parts, other._parts, strict=True):
            np.add(own, more.reshape(-1, count, 3).mean(axis=1), out=own)

    def put(self, rows: Ints, other: Received, chance: float) -> None:
        """Set `rows` to `other`, which came by chance."""
        for own, more in zip(self._parts, other._parts, strict=True):
            own[rows] = more / chance

    def darken(self, rows: Ints) -> None:
        """Set `rows` to 0."""
        for part in self._parts:
            part[rows] = 0

    def find_lit(self) -> Ints:
        """Return the rows that are not dark."""
        lit = np.zeros(len(self.irradiance), bool)
        for part in self._parts:
            red, green, blue = part.T
            lit |= (red > 0) | (green > 0) | (blue > 0)
        return np.flatnonzero(lit)

    def leave(self, albedo: Array) -> Array:
        """Return the radiance that is reflected, (n, 3)."""
        diffuse: Array = albedo / np.pi * self.irradiance
        return diffuse if self.glossy is None else diffuse + self.glossy

    @property
    def _parts(self) -> list[Array]:
        return [self.irradiance] if self.glossy is None else [self.irradiance, self.glossy]


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
        unlit = EmittingSurfaces(tracer.scene, unlit=True)
        self._unlit: list[Emitter] = [unlit] if unlit.are_there else []
        self._seen = [emitter for emitter in emitters if emitter.is_seen] + self._unlit
        self.met = [emitter for emitter in self._each if emitter.can_be_met]
        self.varies = bool(self._chosen) or any(emitter.spreads for emitter in self._each)
        powers = np.array([emitter.power for emitter in self._chosen])
        if self._chosen:
            self._chances = (1 - ALIKE) * powers / powers.sum() + ALIKE / len(powers)

    def sample_well(self, at: Receivers, count: int, rng: np.random.Generator) -> Received:
        """Return the light on surfaces (n), the mean over `count` points of emitters spread evenly."""
        number = len(at.hits.face)
        total = Received.none(at)
        repeated = None
        for emitter in self._each:
            if not emitter.spreads:
                total.add(self._light(emitter, at, np.zeros((number, 2))))
                continue
            points = make_lattices(number, count, rng)
            repeated = repeated or at.rows(np.repeat(np.arange(number), count))
            total.add(self._light(emitter, repeated, points), count)
        if self._chosen:
            points = make_lattices(number, count, rng)
            repeated = repeated or at.rows(np.repeat(np.arange(number), count))
            total.add(self._light_by_choice(repeated, points), count)
        return total

    def sample(self, at: Receivers, rng: np.random.Generator) -> Received:
        """Return the light on surfaces by a random point of each emitter."""
        total = Received.none(at)
        for emitter in self._each:
            total.add(self._light(emitter, at, rng.random((len(at.hits.face), 2))))
        if self._chosen:
            total.add(self._light_by_choice(at, rng.random((len(at.hits.face), 2))))
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

    def meet_by_gloss(self, origins: Array, directions: Array, densities: Array, found: Hits) -> Array:
        """Return the radiance of emitters along rays by the glossy part that hit `found`, weighted, (n, 3).

        directions: unit, (n, 3), drawn with `densities` (n,).
        """
        total = np.zeros((len(origins), 3))
        each = [(emitter, 1.0) for emitter in self._each]
        chosen = zip(self._chosen, self._chances, strict=True) if self._chosen else []
        for emitter, chance in [*each, *chosen, *((emitter, 0.0) for emitter in self._unlit)]:
            if emitter.spreads:
                radiance, density = emitter.meet(origins, directions, found)
                total += _colour(radiance, weigh_bounce(density * chance, densities), emitter)
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

    def _light(self, emitter: Emitter, at: Receivers, points: Array) -> Received:
        """Return the light on surfaces from points of an emitter, (n, 2) in the unit square."""
        return self._cast_shadows(at, *self._find_unshadowed(emitter, at, points))

    def _light_by_choice(self, at: Receivers, points: Array) -> Received:
        """Return the light from a point of one light for each surface; first coordinates also say of which."""
        stops = np.cumsum(self._chances)
        which = np.minimum(np.searchsorted(stops, points[:, 0], side="right"), len(stops) - 1)
        rest = np.clip((points[:, 0] - (stops - self._chances)[which]) / self._chances[which], 0, 1)
        ends, light = np.zeros((len(points), 3)), Received.none(at)
        order = np.argsort(which, kind="stable")
        bounds = np.searchsorted(which[order], np.arange(len(stops) + 1))
        for number in np.flatnonzero(np.diff(bounds)):
            rows = order[bounds[number] : bounds[number + 1]]
            part = np.stack([rest[rows], points[rows, 1]], axis=1)
            chance = self._chances[number]
            ends[rows], found = self._find_unshadowed(self._chosen[number], at.rows(rows), part, chance)
            light.put(rows, found, chance)
        return self._cast_shadows(at, ends, light)

    def _find_unshadowed(
        self, emitter: Emitter, at: Receivers, points: Array, chance: float = 1.0
    ) -> tuple[Array, Received]:
        """Return where shadow rays end, (n, 3), and the light if they meet nothing; chance: that of the emitter."""
        hits = at.hits
        found = emitter.sample(hits.position, points)
        faces = dot(found.to, hits.normal) > 0
        cosines = np.where(faces, np.maximum(dot(found.to, hits.shading_normal), 0), 0)
        diffuse = cosines
        if emitter in self.met:
            diffuse = cosines * weigh_light(found.over, cosines / np.pi)
        if at.to_viewer is not None:
            diffuse = diffuse * at.keep(found.to)
        irradiance = _receive(found, diffuse, emitter)
        if not at.shows_gloss:
            return found.ends, Received(irradiance, None)
        if emitter.spreads:
            cosines = cosines * weigh_light(found.density * chance, at.find_density(found.to))
        glossy = _receive(found, cosines, emitter) * at.reflect(found.to)
        return found.ends, Received(irradiance, glossy)

    def _cast_shadows(self, at: Receivers, ends: Array, light: Received) -> Received:
        """Return `light`, 0 where something lies on the way to `ends` (n, 3)."""
        lit, hits = light.find_lit(), at.hits
        hidden = self._tracer.occluded(self._tracer.lift(hits.position[lit], hits.normal[lit]), ends[lit])
        light.darken(lit[hidden])
        return light


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


def _receive(found: Arriving, cosines: Array, emitter: Emitter) -> Array:
    """Return the irradiance, (n, 3), of what arrives from an emitter at `cosines` (n,)."""
    if found.strength.ndim > 1:
        return found.strength * (cosines / found.over)[:, None] * emitter.emission
    return np.multiply.outer(found.strength * cosines / found.over, emitter.emission)


def _find_emitters(scene: Scene) -> list[Emitter]:
    """Return the lights of a scene that are on, and its emitting surfaces."""
    low, high = scene.geometry.bounds
    around = Surroundings((low + high) / 2, max(float(np.linalg.norm(high - low)) / 2, TINY))
    emitters: list[Emitter] = [_find_twin(light.kind)(light, around) for light in scene.lights]
    surfaces = EmittingSurfaces(scene)
    if surfaces.are_there:
        emitters.append(surfaces)
    return [emitter for emitter in emitters if emitter.power > 0]


@cache
def _find_twin(kind: str) -> Callable[[Any, Surroundings], Emitter]:
    """Return the twin of a kind of light, from the file of that name."""
    twin: Callable[[Any, Surroundings], Emitter] = importlib.import_module(f"deferred_ir.truth.emitters.{kind}").TWIN
    return twin
