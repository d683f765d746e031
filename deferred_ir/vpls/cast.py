"""Cast virtual point lights (VPLs): rays from the lights, each of which makes a diffuse light where it lands (Keller
1997).

Each of N rays carries its part of a light's flux; one with flux P makes a VPL of intensity P rho/pi cos(theta). As N
grows, their sum is exactly one diffuse bounce. Of glossy surfaces they carry the diffuse part. Lights get rays by their
luminous flux: each the whole number below or above its share, and over the seeds its share exactly, however small.

Further bounces continue the paths. From the VPLs of one bounce, M are drawn by systematic resampling with probability
proportional to their luminous power, and a ray leaves each about its normal, cosine-distributed. M falls from bounce to
bounce as the power does, so that all VPLs carry about the same power, as in Keller's fixed fractions. Those go by the
scene's mean reflectance; drawing by power is unbiased in any scene, and unlike with Russian roulette the luminous power
of a bounce does not fluctuate: the M rays together carry on exactly the power that arrived.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from typing import TypeVar

import numpy as np

from deferred_ir.base.arrays import Array, Ints
from deferred_ir.base.colour import LUMINANCE
from deferred_ir.rays.tracer import Tracer
from deferred_ir.sampling import streams
from deferred_ir.sampling.patterns import Pattern, resample_systematically, sample_unit_disc, sample_unit_square
from deferred_ir.sampling.warps import lift_to_hemisphere, square_to_disc
from deferred_ir.scene.lights.base import Bounds, Light
from deferred_ir.vpls.kernel import cosine_ratio

L = TypeVar("L", bound=Light)


@dataclass(frozen=True, eq=False)
class Vpls:
    """n VPLs, arrays (n, 3), which shine as I(w) = emission cos(theta) about their normal.

    ray: int (n,), the number of the ray that made the VPL, among the rays of its bounce.
    """

    position: Array
    normal: Array
    emission: Array
    ray: Ints

    def __len__(self) -> int:
        return len(self.ray)


NONE = Vpls(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0, int))


def cast(
    lights: Sequence[Light], tracer: Tracer, count: int, pattern: Pattern = "random", seed: int = 0, *, bounces: int = 1
) -> Vpls:
    """Cast `count` rays from `lights` and follow them for `bounces` bounces. Returns the VPLs, the first bounce first.

    Rays that miss or carry no power make no VPL and are not replaced.
    """
    if count == 0 or not lights:
        return NONE
    origins, directions, carried = _start_rays(lights, tracer.scene.bounds, count, pattern, seed)
    left = (carried @ LUMINANCE).sum()
    by_bounce = [_make_vpls(tracer, origins, directions, carried)]
    for bounce in range(1, bounces):
        last = by_bounce[-1]
        power = last.emission @ LUMINANCE
        # Smooth normals can raise the power, but buffers have room for `count` VPLs a bounce.
        rays = min(count, round(count * power.sum() / left)) if left > 0 else 0
        if rays == 0:
            break
        rng = streams.bounce(seed, bounce)
        drawn = resample_systematically(power, rays, rng.random())
        # Each bounce has its own pattern, shuffled: in order it would correlate with that of the bounce before.
        square = rng.permutation(sample_unit_square(pattern, rays, streams.bounce_pattern(seed, bounce)))
        normal = last.normal[drawn]
        carried = last.emission[drawn] * (power.sum() / (rays * power[drawn]))[:, None]
        directions = lift_to_hemisphere(square_to_disc(square), normal)
        by_bounce.append(_make_vpls(tracer, tracer.lift(last.position[drawn], normal), directions, carried))
    return join(by_bounce)


def join(parts: Sequence[Vpls]) -> Vpls:
    """Return the VPLs of all parts, of which there is one at least."""
    if len(parts) == 1:
        return parts[0]
    return Vpls(*(np.concatenate([getattr(part, f.name) for part in parts]) for f in fields(Vpls)))


def _start_rays(
    lights: Sequence[Light], bounds: Bounds, count: int, pattern: Pattern, seed: int
) -> tuple[Array, Array, Array]:
    """Return the rays of the first bounce: origins, unit directions and flux over pi that they carry, (n, 3) each."""
    points, places = sample_unit_disc(pattern, count, seed), None
    if any(light.has_area for light in lights):
        square = sample_unit_square(pattern, count, streams.light_disc_pattern(seed))
        places = square_to_disc(streams.light_disc(seed).permutation(square))
    if len(lights) == 1:
        return lights[0].emit(points, places if lights[0].has_area else None, bounds)
    parts = []
    for light, part, factor in deal_rays(lights, bounds, count, seed):
        # A stretch of a well spread sequence is well spread.
        own = places[part] if places is not None and light.has_area else None
        origins, directions, carried = light.emit(points[part], own, bounds)
        parts.append((origins, directions, carried * factor))
    origins, directions, carried = (np.concatenate(column) for column in zip(*parts, strict=True))
    return origins, directions, carried


def deal_rays(lights: Sequence[L], bounds: Bounds, count: int, seed: int) -> Iterator[tuple[L, slice, float]]:
    """Deal `count` rays to lights by flux. Yields each light that gets some, which, and a factor on what they carry.

    A light that should get less than one ray gets one in some frames, and then carries as much more.
    """
    flux = np.array([light.measure_flux(bounds) for light in lights])
    if not flux.sum() > 0:
        return
    drawn = resample_systematically(flux, count, streams.dealing(seed).random())
    given = np.bincount(drawn, minlength=len(lights))
    wanted = flux / flux.sum() * count
    ends = np.cumsum(given)
    for light, many, share, end in zip(lights, given.tolist(), wanted.tolist(), ends.tolist(), strict=True):
        if many:
            yield light, slice(end - many, end), 1.0 if share >= 1 else many / share


def _make_vpls(tracer: Tracer, origins: Array, directions: Array, carried: Array) -> Vpls:
    """Trace rays with powers `carried` (n, 3). Returns the VPLs that they make."""
    hits = tracer.closest(origins, directions)
    ratio = cosine_ratio(hits.normal, hits.shading_normal, directions)
    emission = carried * hits.reflect_diffusely(directions) * ratio[:, None]
    alive = np.flatnonzero(hits.hit & (emission > 0).any(axis=1))
    return Vpls(hits.position[alive], hits.normal[alive], emission[alive], alive)
