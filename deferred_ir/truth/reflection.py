"""How surfaces reflect, for the path tracer: glTF 2.0, Appendix B, in formulas of its own.

What a material says at a point is what `Hits` carry. A surface is a mixture of a matt dielectric under a coat and of a
metal, both with one GGX lobe. Shadowing is Smith's by slopes (Heitz 2014), and directions come from the normals that
are visible (Heitz 2018, "Sampling the GGX Distribution of Visible Normals").
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from deferred_ir.base.arrays import Array, Ints
from deferred_ir.rays.tracer import Hits
from deferred_ir.scene.surfaces.brdf import Gloss
from deferred_ir.truth.emitters.base import TINY, dot

LEAST = 1e-4
"""Cosines with the shading normal count as this much at least."""


@dataclass(frozen=True, eq=False)
class Receivers:
    """Surfaces that light arrives at, and whence they are seen.

    to_viewer: unit, (n, 3); None if and only if no surface of the scene is glossy. shows_gloss: whether what they
    reflect is their diffuse part and the glossy one; else it is the diffuse part alone.
    """

    hits: Hits
    to_viewer: Array | None
    shows_gloss: bool

    @classmethod
    def make(cls, hits: Hits, directions: Array, *, show_gloss: bool) -> Receivers:
        """Make those that rays along `directions` (n, 3), of any length, hit."""
        if hits.gloss is None:
            return cls(hits, None, False)
        return cls(hits, -normalize(directions), show_gloss)

    def rows(self, chosen: Ints) -> Receivers:
        """Return those `chosen`, indices (m,)."""
        seen = None if self.to_viewer is None else self.to_viewer[chosen]
        return Receivers(self.hits.rows(chosen), seen, self.shows_gloss)

    def find_shiny(self) -> Ints:
        """Return the rows of those that show gloss and have some."""
        if not self.shows_gloss:
            return np.zeros(0, int)
        gloss, _ = self._known
        return np.flatnonzero(gloss.f0.any(axis=1) | (gloss.f90 > 0))

    @property
    def _known(self) -> tuple[Gloss, Array]:
        """What is known where there is gloss."""
        assert self.hits.gloss is not None
        assert self.to_viewer is not None
        return self.hits.gloss, self.to_viewer

    def keep(self, to_light: Array) -> Array:
        """Return the fraction of the diffuse part that the coat leaves for unit `to_light` (n, 3), (n,)."""
        if self.hits.gloss is None:
            return np.ones(len(to_light))
        gloss, viewer = self._known
        grazing = _schlick(viewer, to_light)
        kept: Array = 1 - gloss.taken[:, 0] * (1 - grazing) - gloss.taken[:, 1] * grazing
        return kept

    def reflect(self, to_light: Array) -> Array:
        """Return the glossy part of the BRDF for unit `to_light` (n, 3), 1/sr, (n, 3)."""
        gloss, viewer = self._known
        normal = self.hits.shading_normal
        leaving, arriving = np.abs(dot(normal, viewer)), dot(normal, to_light)
        grazing = _schlick(viewer, to_light)[:, None]
        fresnel = gloss.f0 * (1 - grazing) + gloss.f90[:, None] * grazing
        lobe = _count_facets(gloss.alpha, normal, viewer + to_light)
        for cosine in (leaving, arriving):
            above = np.maximum(cosine, LEAST)
            lobe *= _find_visible(gloss.alpha, above) / (2 * above)
        lobe[arriving <= 0] = 0
        reflected: Array = fresnel * lobe[:, None]
        return reflected

    def find_density(self, to_light: Array) -> Array:
        """Return the density by solid angle with which `draw` returns unit `to_light` (n, 3), (n,)."""
        gloss, _ = self._known
        normal = self.hits.shading_normal
        viewer, cosine = self._lift_viewer()
        density = _count_facets(gloss.alpha, normal, viewer + to_light)
        density *= _find_visible(gloss.alpha, cosine) / (4 * cosine)
        density[dot(normal, to_light) <= 0] = 0
        return density

    def draw(self, points: Array) -> Array:
        """Return unit directions, (n, 3), distributed about as the glossy part, for points of the unit square (n, 2).

        Some point below the surface; nothing is reflected there.
        """
        gloss, _ = self._known
        normal = self.hits.shading_normal
        viewer, cosine = self._lift_viewer()
        # A frame in which the viewer lies in the plane of the first and the last axis.
        side = viewer - normal * cosine[:, None]
        other = np.cross(normal, np.eye(3)[np.abs(normal).argmin(axis=1)])
        first = normalize(np.where(dot(side, side)[:, None] > 1e-18, side, other))
        second = np.cross(normal, first)
        x, z = gloss.alpha * np.sqrt(1 - cosine**2), cosine
        length = np.hypot(x, z)
        x, z = x / length, z / length
        radius, angle = np.sqrt(points[:, 0]), 2 * np.pi * points[:, 1]
        across, along = radius * np.cos(angle), radius * np.sin(angle)
        share = (1 + z) / 2
        along = (1 - share) * np.sqrt(1 - across**2) + share * along
        towards = np.sqrt(np.maximum(1 - across**2 - along**2, 0))
        # `across` goes along the second axis, `along` upwards across the line of sight, -z and x in the first and last.
        slopes = np.stack([gloss.alpha * (towards * x - along * z), gloss.alpha * across], axis=1)
        up = np.maximum(towards * z + along * x, 0)
        half = normalize(first * slopes[:, :1] + second * slopes[:, 1:] + normal * up[:, None])
        return normalize(half * (2 * dot(viewer, half))[:, None] - viewer)

    def _lift_viewer(self) -> tuple[Array, Array]:
        """Return unit directions to viewers above the shading normals, mirrored if need be, and their cosines."""
        _, viewer = self._known
        normal = self.hits.shading_normal
        height = dot(normal, viewer)
        cosine = np.clip(np.abs(height), LEAST, 1)
        side = viewer - normal * height[:, None]
        flat = normalize(side) * np.sqrt(1 - cosine**2)[:, None]
        return flat + normal * cosine[:, None], cosine


def normalize(vectors: Array) -> Array:
    """Return `vectors` (n, 3) at unit length; 0 where they have none."""
    unit: Array = vectors / np.maximum(np.sqrt(dot(vectors, vectors)), TINY)[:, None]
    return unit


def _schlick(viewer: Array, to_light: Array) -> Array:
    """Return (1 - c)^5, c the cosine of unit directions with the half vector between them, (n,)."""
    middle = viewer + to_light  # twice as long as c
    grazing: Array = (1 - np.minimum(np.sqrt(dot(middle, middle)) / 2, 1)) ** 5
    return grazing


def _count_facets(alpha: Array, normal: Array, middle: Array) -> Array:
    """Return GGX's density of facets that face along `middle` (n, 3), of any length, (n,)."""
    half = normalize(middle)
    up = dot(normal, half)
    side = half - normal * up[:, None]
    density: Array = 1 / (np.pi * alpha**2 * (dot(side, side) / alpha**2 + up**2) ** 2)
    return density


def _find_visible(alpha: Array, cosine: Array) -> Array:
    """Return the fraction of facets that is visible from directions above the surface, (n,) (Smith)."""
    slope = alpha**2 * (1 / cosine**2 - 1)
    visible: Array = 2 / (1 + np.sqrt(1 + np.maximum(slope, 0)))
    return visible
