"""glTF's metallic-roughness model (specification 2.0, Appendix B): GGX, Smith's separable shadowing, Schlick's Fresnel.

A surface mixes a dielectric, matt under a coat, with a metal, by `metallic`. Both have the same GGX lobe, so that

    brdf = albedo / pi * kept + (f0 + (f90 - f0) x) * D V,    kept = 1 - (taken0 + (taken90 - taken0) x),

where x = (1 - |v . h|)^5 and albedo = (1 - metallic) base colour. KHR_materials_specular weighs the coat, and
KHR_materials_ior says its reflectance head-on. shaders/lib/surface/brdf.glsl computes the same.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from deferred_ir.base.arrays import Array, Bools, Ints
from deferred_ir.sampling.warps import build_basis
from deferred_ir.scene.surfaces.materials import Material

MIN_ALPHA = 1e-3
"""Least width of the lobe, roughness 0.03: narrower than a pixel, and wide enough for 16 bits of a normal."""
MEAN_GRAZING = (0.02816558, -0.07988039, 0.08654912, -0.043782, 0.00903063)
"""Coefficients, from the constant up, of a polynomial in the cosine of one direction: see `_average_grazing`."""
LEAST_COSINE = 1e-4
"""Cosines with the shading normal are taken as this much at least: the viewer may see a surface edge-on, or from below
its shading normal."""


@dataclass(frozen=True, eq=False)
class Gloss:
    """What the gloss of n surfaces follows from, all float64 and without dimension.

    f0, f90: reflectance head-on (n, 3) and at grazing angles (n,). taken: the fractions of diffuse light that a coat
    takes head-on and at grazing angles, (n, 2). alpha: width of the GGX lobe, (n,).
    """

    f0: Array
    f90: Array
    taken: Array
    alpha: Array

    def rows(self, chosen: Ints | slice) -> Gloss:
        """Return that of the surfaces `chosen`."""
        return Gloss(*(getattr(self, field.name)[chosen] for field in fields(self)))

    def spread(self, known: Bools) -> Gloss:
        """Return that of rows of which `known` (n,) are these surfaces, in order; others have none."""
        parts = []
        for field in fields(self):
            own = getattr(self, field.name)
            parts.append(np.zeros((len(known), *own.shape[1:])))
            parts[-1][known] = own
        return Gloss(*parts)


def make_gloss(
    materials: Sequence[Material], numbers: Ints, base_color: Array, metallic: Array, roughness: Array
) -> tuple[Array, Gloss]:
    """Return albedo (n, 3) and gloss of surfaces.

    numbers: their materials, (n,). base_color (n, 3), metallic and roughness (n,): as their textures say.
    """
    head_on = np.array([find_head_on(material) for material in materials])[numbers]
    weight = np.array([material.specular for material in materials], dtype=np.float64)[numbers]
    rest = 1 - metallic
    coat = rest * weight
    taken = np.stack([weight * head_on.max(axis=1), weight], axis=1)
    f0 = coat[:, None] * head_on + metallic[:, None] * base_color
    return rest[:, None] * base_color, Gloss(f0, coat + metallic, taken, np.maximum(roughness**2, MIN_ALPHA))


def find_head_on(material: Material) -> tuple[float, float, float]:
    """Return the reflectance of a material's coat head-on, linear RGB, not yet weighed by `specular`."""
    plain = ((material.ior - 1) / (material.ior + 1)) ** 2 if material.ior > 0 else 1.0
    red, green, blue = (min(plain * factor, 1.0) for factor in material.specular_color)
    return red, green, blue


def eval(gloss: Gloss, normal: Array, to_viewer: Array, to_light: Array) -> tuple[Array, Array]:
    """Return what is left of the diffuse part, `kept` (n,), and the glossy part of the BRDF, (n, 3), 1/sr.

    normal: the shading normal. Vectors are unit, (n, 3). The glossy part is 0 where the light is below the surface.
    """
    half = _normalize(to_viewer + to_light)
    x = _weigh_grazing(to_viewer, half)
    kept = 1 - (gloss.taken[:, 0] + (gloss.taken[:, 1] - gloss.taken[:, 0]) * x)
    lobe = _distribute(gloss.alpha, normal, half) * _shadow(gloss.alpha, normal, to_viewer, to_light)
    return kept, find_reflectance(gloss, x) * lobe[:, None]


def find_reflectance(gloss: Gloss, x: Array) -> Array:
    """Return Schlick's reflectance (n, 3) at `x`, (1 - |v . h|)^5, (n,)."""
    reflectance: Array = gloss.f0 + (gloss.f90[:, None] - gloss.f0) * x[:, None]
    return reflectance


def sample(gloss: Gloss, normal: Array, to_viewer: Array, points: Array) -> tuple[Array, Array]:
    """Return directions of the glossy part, and its BRDF times cosine over their density, (n, 3) each.

    points: of the unit square, (n, 2). Normals are drawn as the viewer sees them, by spherical caps (Dupuy and Benyoub
    2023). The second is 0 for directions below the surface.
    """
    right, up = build_basis(normal)
    viewer = _lift_viewer(normal, to_viewer)
    local = np.stack([_dot(viewer, axis) for axis in (right, up, normal)], axis=1)
    local[:, 2] = np.maximum(local[:, 2], LEAST_COSINE)
    widths = np.stack([gloss.alpha, gloss.alpha, np.ones(len(local))], axis=1)
    seen = _normalize(local * widths)
    height = (1 - points[:, 1]) * (1 + seen[:, 2]) - seen[:, 2]
    radius, angle = np.sqrt(np.clip(1 - height**2, 0, 1)), 2 * np.pi * points[:, 0]
    cap = np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=1)
    half = _normalize((cap + seen) * widths)
    cosine = _dot(local, half)
    way = 2 * cosine[:, None] * half - local
    lit = _mask(gloss.alpha, way[:, 2]) * (way[:, 2] > 0)
    weight = find_reflectance(gloss, (1 - np.clip(cosine, 0, 1)) ** 5) * lit[:, None]
    directions = right * way[:, :1] + up * way[:, 1:2] + normal * way[:, 2:]
    below = np.flatnonzero(_dot(normal, to_viewer) < 0)
    if len(below):
        part = gloss.rows(below), normal[below], to_viewer[below], directions[below]
        density = np.maximum(pdf(*part), np.finfo(float).tiny)
        weight[below] = eval(*part)[1] * (np.maximum(way[below, 2], 0) / density)[:, None]
    return directions, weight


def pdf(gloss: Gloss, normal: Array, to_viewer: Array, to_light: Array) -> Array:
    """Return the density by solid angle, (n,), with which `sample` draws `to_light`; arguments as for `eval`."""
    viewer = _lift_viewer(normal, to_viewer)
    half = _normalize(viewer + to_light)
    cosine = np.maximum(_dot(normal, viewer), LEAST_COSINE)
    density: Array = _distribute(gloss.alpha, normal, half) * _mask(gloss.alpha, cosine) / (4 * cosine)
    return np.where(_dot(normal, to_light) > 0, density, 0.0)


def find_mean_kept(gloss: Gloss, cosines: Array) -> Array:
    """Return the cosine-weighted mean of `kept` over all outgoing directions, (n,): a diffuse bounce's energy.

    cosines: of the incoming direction with the normal, (n,).
    """
    x = _average_grazing(cosines)
    kept: Array = 1 - (gloss.taken[:, 0] + (gloss.taken[:, 1] - gloss.taken[:, 0]) * x)
    return kept


def _distribute(alpha: Array, normal: Array, half: Array) -> Array:
    """Return the density of microfacets' normals (n,) (GGX: Walter et al. 2007, equation 33)."""
    # The sine by a cross product: 1 - cos^2 has no digits left in a narrow lobe.
    side = np.cross(normal, half)
    density: Array = alpha**2 / (np.pi * (_dot(side, side) + (alpha * _dot(normal, half)) ** 2) ** 2)
    return density


def _mask(alpha: Array, cosine: Array) -> Array:
    """Return the fraction of microfacets that is seen at `cosine` (n,) with the normal (Smith's G1)."""
    part: Array = 2 * cosine / np.maximum(cosine + np.sqrt(alpha**2 + (1 - alpha**2) * cosine**2), LEAST_COSINE)
    return part


def _shadow(alpha: Array, normal: Array, to_viewer: Array, to_light: Array) -> Array:
    """Return G / (4 |n . v| |n . l|), Smith's separable shadowing over what turns D into a BRDF, (n,)."""
    result: Array = (_dot(normal, to_light) > 0).astype(np.float64)
    for way in (to_viewer, to_light):
        cosine = np.maximum(np.abs(_dot(normal, way)), LEAST_COSINE)
        result = result / (cosine + np.sqrt(alpha**2 + (1 - alpha**2) * cosine**2))
    return result


def _lift_viewer(normal: Array, to_viewer: Array) -> Array:
    """Return ways to the viewer, mirrored in the surface where they lie below its shading normal."""
    lifted: Array = to_viewer - 2 * np.minimum(_dot(normal, to_viewer), 0)[:, None] * normal
    return lifted


def _weigh_grazing(to_viewer: Array, half: Array) -> Array:
    """Return (1 - |v . h|)^5, (n,)."""
    weight: Array = (1 - np.clip(np.abs(_dot(to_viewer, half)), 0, 1)) ** 5
    return weight


def _average_grazing(cosines: Array) -> Array:
    """Return the cosine-weighted mean of (1 - |v . h|)^5 over the hemisphere, (n,), to 1e-4."""
    mean: Array = np.polynomial.polynomial.polyval(np.clip(cosines, 0, 1), MEAN_GRAZING)
    return mean


def _normalize(vectors: Array) -> Array:
    length = np.sqrt(np.einsum("ij,ij->i", vectors, vectors))
    unit: Array = vectors / np.maximum(length, 1e-30)[:, None]
    return unit


def _dot(a: Array, b: Array) -> Array:
    products: Array = np.einsum("ij,ij->i", a, b)
    return products
