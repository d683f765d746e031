"""The light that a VPL brings to a surface, without shadows: the formulas of shaders/lib/lights/vpl.glsl on the CPU.

A VPL of emission E_i brings irradiance E_i cos(theta_y) cos(theta_x) / max(d^2, c^2): to surfaces inside its cone only,
and never through the back of a face. Arrays of vectors have their coordinates along the first axis here, (3, ...), so
that whole rows of numbers go through the innermost loop; the other axes are broadcast.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from deferred_ir.base.arrays import Array, Bools
from deferred_ir.scene.lights.spotlight import one_minus_cos

TINY = np.float32(1e-37)
"""Keeps divisors off 0 where a VPL lies on the surface and the cosines are 0."""


@dataclass(frozen=True)
class VplLimits:
    """The cone and the clamp that all VPLs of an image share.

    clamp: c, world units; 1/d^2 is taken as 1/max(d^2, c^2), and 0 clamps nothing. cosine: of half the cone's opening
    angle; 0 is the whole hemisphere.
    """

    clamp: float
    cosine: float = 0.0

    @classmethod
    def from_angle(cls, fov: float, clamp: float) -> VplLimits:
        """Limits of VPLs whose cones have the full opening angle `fov`, degrees up to 180; clamp: in world units."""
        return cls(clamp, 1 - one_minus_cos(fov) if fov < 180 else 0.0)

    @property
    def edge(self) -> np.float32:
        """The squared cosine of half the cone's angle."""
        return np.float32(self.cosine**2)

    def missing(self, square: Array, leaving: Array) -> Array:
        """Return the fraction of the light from nearer than c that VPLs leave out, (n,), as short rays replace it.

        square: squared distances (n,), world units. leaving: cosines at the surfaces that send the light, (n,). Inside
        the cone it is 1 - d^2/c^2, outside it 1. From farther than c it is 0, although the cone loses light there, too.
        """
        fraction: Array = np.maximum(1 - square / self.clamp**2, 0)
        fraction[(leaving < self.cosine) & (fraction > 0)] = 1
        return fraction


def find_lit(way: Array, vpl_normal: Array, normal: Array, shading_normal: Array, edge: np.float32) -> Bools:
    """Return whether VPLs light surfaces where nothing lies between, bool (...).

    way: from VPLs to surfaces, (3, ...). normal, shading_normal: of the surfaces, (3, ...); one array where they are
    the same. edge: see `VplLimits.edge`.
    """
    lit = _faces(way, _dot(way, way), _dot(vpl_normal, way), normal, edge)
    if shading_normal is not normal:
        lit &= _dot(shading_normal, way) < 0
    return lit


def weigh(
    way: Array, vpl_normal: Array, normal: Array, shading_normal: Array, *, edge: np.float32, clamp: np.float32
) -> Array:
    """Return cos cos / max(d^2, c^2), (...), which is irradiance without shadows over a VPL's emission.

    Arguments as in `find_lit`. clamp: c^2. Lengths are in a unit in which fourth powers of distances fit the precision
    of `way`.
    """
    square, leaving = _dot(way, way), _dot(vpl_normal, way)
    arriving = np.maximum(-_dot(shading_normal, way), 0)
    weights: Array = leaving * arriving / np.maximum(square * np.maximum(square, clamp), TINY)
    weights[~_faces(way, square, leaving, normal, edge)] = 0
    return weights


def _faces(way: Array, square: Array, leaving: Array, normal: Array, edge: np.float32) -> Bools:
    """Return whether light leaves a VPL inside its cone and meets a face from the front, (...).

    square: |way|^2. leaving: cosine at the VPL times |way|.
    """
    faces: Bools = (leaving > 0) & (leaving * leaving >= edge * square) & (_dot(normal, way) < 0)
    return faces


def _dot(a: Array, b: Array) -> Array:
    """Return the dot products (...) of vectors (3, ...)."""
    total: Array = a[0] * b[0]
    total += a[1] * b[1]
    total += a[2] * b[2]
    return total


def cosine_ratio(normal: Array, shading_normal: Array, directions: Array) -> Array:
    """Return what to multiply the light of rays by where they land on a shaded surface, (n,).

    Radiance at a hit goes with the shading normal's cosine to the light, but the surface that receives the ray and
    radiates is the geometric one; the ratio of the two cosines makes the sum of VPLs exact (Veach 1997, section 5.3).
    All arguments are unit vectors (n, 3), `directions` those of the rays; 0 where a ray meets the back of a face.
    """
    arriving = np.maximum(-(shading_normal * directions).sum(axis=1), 0)
    crossing = -(normal * directions).sum(axis=1)
    ratio: Array = np.divide(arriving, crossing, out=np.zeros(len(crossing)), where=crossing > 0)
    return ratio
