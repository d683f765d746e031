"""Cast virtual point lights (VPLs): rays from the spotlight, each of which makes a diffuse light where it lands (Keller
1997).

Rays are uniform on the disc of radius r = sin(fov/2), lifted to the sphere (Nusselt's analogue), so each of N carries
E r^2/N cone(theta), and the VPL it makes has E_i = E r^2/N cone(theta) rho. As N grows, their sum is exactly one
diffuse bounce. With a disc light, each ray starts at a random point of the disc.

Further bounces continue the paths. From the VPLs of one bounce, M are drawn by systematic resampling with probability
proportional to their luminous power, and a ray leaves each about its normal, cosine-distributed. M falls from bounce to
bounce as the power does, so that all VPLs carry about the same power, as in Keller's fixed fractions. Those go by the
scene's mean reflectance; drawing by power is unbiased in any scene, and unlike with Russian roulette the luminous power
of a bounce does not fluctuate: the M rays together carry on exactly the power that arrived.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from deferred_ir.base.arrays import Array, Ints
from deferred_ir.base.colour import LUMINANCE
from deferred_ir.rays.tracer import Tracer
from deferred_ir.sampling import streams
from deferred_ir.sampling.patterns import Pattern, resample_systematically, sample_unit_disc, sample_unit_square
from deferred_ir.sampling.warps import lift_to_hemisphere, square_to_disc
from deferred_ir.scene.lights.base import Light
from deferred_ir.vpls.kernel import cosine_ratio


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
    light: Light, tracer: Tracer, count: int, pattern: Pattern = "random", seed: int = 0, *, bounces: int = 1
) -> Vpls:
    """Cast `count` rays and follow them for `bounces` bounces. Returns the VPLs, those of the first bounce first.

    Rays that miss or carry no power make no VPL and are not replaced.
    """
    if count == 0:
        return NONE
    origins, directions, carried = _start_rays(light, count, pattern, seed)
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
    if len(by_bounce) == 1:
        return by_bounce[0]
    return Vpls(*(np.concatenate([getattr(part, f.name) for part in by_bounce]) for f in fields(Vpls)))


def _start_rays(light: Light, count: int, pattern: Pattern, seed: int) -> tuple[Array, Array, Array]:
    """Return the rays of the first bounce: origins, unit directions and what they carry, (n, 3) each."""
    places = None
    if light.has_area:
        square = sample_unit_square(pattern, count, streams.light_disc_pattern(seed))
        places = square_to_disc(streams.light_disc(seed).permutation(square))
    return light.emit(sample_unit_disc(pattern, count, seed), places)


def _make_vpls(tracer: Tracer, origins: Array, directions: Array, carried: Array) -> Vpls:
    """Trace rays with powers `carried` (n, 3). Returns the VPLs that they make."""
    hits = tracer.closest(origins, directions)
    emission = carried * hits.albedo * cosine_ratio(hits.normal, hits.shading_normal, directions)[:, None]
    alive = np.flatnonzero(hits.hit & (emission > 0).any(axis=1))
    return Vpls(hits.position[alive], hits.normal[alive], emission[alive], alive)
