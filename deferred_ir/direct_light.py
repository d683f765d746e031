"""Irradiance by the spotlight where rays land, with ray-cast shadows: the formula of shaders/lib/light.glsl."""

from __future__ import annotations

import numpy as np

from .lights import Spotlight, frames
from .sampling import disc
from .tracing import Hits, Tracer
from .typing import Array


def lit_by(light: Spotlight, tracer: Tracer, at: Hits, rng: np.random.Generator) -> Array:
    """Irradiance on surfaces `at` (n, all of them hit) divided by the spotlight's emission, float64 (n,).

    A disc light is asked at one random point of its disc for each surface, a point light at its position.
    """
    source = np.asarray(light.position, float)
    if light.radius > 0:
        right, up = frames(light.axis)
        points = light.radius * disc(rng.random((len(at.face), 2)))
        source = source + points[:, :1] * right + points[:, 1:] * up
    to = source - at.position
    square = np.maximum(_dot(to, to), np.finfo(float).tiny)
    to /= np.sqrt(square)[:, None]
    facing = _dot(to, at.normal) > 0
    strength = np.maximum(_dot(to, at.shading_normal), 0) * facing
    strength *= np.maximum(-to @ light.axis, 0) * light.cone(-to) / square
    lit = np.flatnonzero(strength)
    starts = tracer.lift(at.position[lit], at.normal[lit])
    ends = np.broadcast_to(source, at.position.shape)[lit]
    strength[lit[tracer.occluded(starts, ends)]] = 0
    return strength


def _dot(a: Array, b: Array) -> Array:
    products: Array = np.einsum("ij,ij->i", a, b)
    return products
