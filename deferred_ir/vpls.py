"""Casting virtual point lights: rays from the spotlight, a diffuse light where each lands (Keller 1997).

Rays are uniform on the disc of radius r = sin(fov/2), lifted to the sphere (Nusselt's analogue), so each of N carries
E r^2/N cone(theta), and the VPL it makes has E_i = E r^2/N cone(theta) rho. As N grows, their sum is exactly one
diffuse bounce.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .lights import Spotlight, frames
from .sampling import Pattern, disc, unit_square
from .tracing import Tracer
from .typing import Array, Ints


@dataclass(frozen=True, eq=False)
class Vpls:
    """n living VPLs; float64 (n, 3) each. They shine as I(w) = emission cos(theta) about their normal.

    ray: int (n,), which of the N rays made it.
    """

    position: Array
    normal: Array
    emission: Array
    ray: Ints

    def __len__(self) -> int:
        return len(self.ray)


NONE = Vpls(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0, int))


def cast(light: Spotlight, tracer: Tracer, count: int, pattern: Pattern = "random", seed: int = 0) -> Vpls:
    """The VPLs of `count` rays; rays that miss or have no power make none and are not replaced."""
    if count == 0:
        return NONE
    radius = np.sin(np.radians(light.fov) / 2)
    points = disc(unit_square(pattern, count, seed)) * radius
    right, up = frames(light.axis)
    height = np.sqrt(1 - (points**2).sum(axis=1, keepdims=True))
    directions = points[:, :1] * right + points[:, 1:] * up + height * light.axis
    hits = tracer.closest(np.broadcast_to(np.asarray(light.position, float), (count, 3)), directions)
    power = np.multiply.outer(light.cone(directions) * radius**2 / count, np.asarray(light.emission, float))
    # Radiance at a hit goes with the shading normal's cosine to the light, but the surface that receives the ray and
    # radiates is the geometric one; the ratio of the two cosines makes the sum exact (Veach 1997, section 5.3).
    arriving = np.maximum(-(hits.shading_normal * directions).sum(axis=1), 0)
    crossing = -(hits.normal * directions).sum(axis=1)
    ratio = np.divide(arriving, crossing, out=np.zeros(count), where=crossing > 0)
    emission = power * hits.albedo * ratio[:, None]
    alive = np.flatnonzero(hits.hit & (emission > 0).any(axis=1))
    return Vpls(hits.position[alive], hits.normal[alive], emission[alive], alive)
