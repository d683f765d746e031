"""All emitting triangles of a scene as one light, textures of emission included.

It is no kind that a scene file names: materials say which surfaces emit.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar

import numpy as np

from deferred_ir.base.arrays import Array, Ints, Vec3
from deferred_ir.base.colour import LUMINANCE
from deferred_ir.sampling.warps import disc_to_square, lift_to_hemisphere
from deferred_ir.scene.geometry import Geometry
from deferred_ir.scene.lights.base import Arrivals, Bounds, Flux, LightSamples, Meetings, aim
from deferred_ir.scene.surfaces.materials import Material, Texture
from deferred_ir.scene.surfaces.points import SurfacePoints

LIFT = 2e-5
"""How far off a surface its rays start, in radii of the scene's bounds."""
PROBES = 16
"""Points of a triangle that say how bright its texture is there."""
FLOOR = 0.1
"""Part of a triangle's chance that goes by the mean of its whole texture: probes may miss a bright spot."""


@dataclass(frozen=True, eq=False)
class SurfaceLight:
    """Emitting triangles, those that emit from both sides twice.

    geometry, materials, textures: of the scene. faces: int (m,), of the geometry. sides: 1 or -1, (m,): which side of
    the face. chances: (m,), of being drawn; their sum is 1.
    """

    geometry: Geometry
    materials: tuple[Material, ...]
    textures: tuple[Texture, ...]
    faces: Ints
    sides: Ints
    chances: Array
    flux: float
    kind: ClassVar[str] = "emitting surfaces"
    at_infinity: ClassVar[bool] = False
    motion: ClassVar[None] = None
    emission: ClassVar[Vec3] = (1.0, 1.0, 1.0)
    has_area: ClassVar[bool] = True
    _ends: Array = field(init=False)

    def __post_init__(self) -> None:
        """Add up the chances."""
        object.__setattr__(self, "_ends", np.cumsum(self.chances))

    def _draw(self, square: Array) -> tuple[Array, Array, Array, Array]:
        """Return points, unit normals of the sides that shine, radiance over density, (n, 3) each; density by area."""
        mark = square[:, 0] * self._ends[-1]
        row = np.minimum(np.searchsorted(self._ends, mark, side="right"), len(self.faces) - 1)
        before = np.where(row > 0, self._ends[row - 1], 0.0)
        u = np.clip((mark - before) / np.maximum(self.chances[row], np.finfo(float).tiny), 0, 1)
        root = np.sqrt(u)
        weights = np.stack([1 - root, root * (1 - square[:, 1]), root * square[:, 1]], axis=1)
        faces = self.faces[row]
        corners = self.geometry.positions[self.geometry.faces[faces]]
        position = np.einsum("nij,ni->nj", corners, weights)
        radiance = SurfacePoints(self.geometry, self.materials, self.textures, faces, weights).look_up_emission()
        density = self.chances[row] / self.geometry.face_areas[faces]
        return (
            position,
            self.geometry.face_normals[faces] * self.sides[row][:, None],
            radiance / density[:, None],
            density,
        )

    def emit(self, points: Array, places: Array | None, bounds: Bounds) -> Flux:
        """Return rays that leave places on them, cosine-distributed."""
        assert places is not None
        position, normal, weight, _ = self._draw(disc_to_square(places))
        return position + normal * (LIFT * bounds.radius), lift_to_hemisphere(points, normal), weight / len(points)

    def measure_flux(self, bounds: Bounds) -> float:
        """Return their luminous flux over pi."""
        del bounds
        return self.flux

    def spread(self, square: Array, bounds: Bounds) -> LightSamples:
        """Return points on them."""
        del bounds
        position, normal, weight, _ = self._draw(square)
        return LightSamples(position, normal, weight / len(square))

    def sample(self, at: Array, places: Array | None, bounds: Bounds) -> Arrivals:
        """Return what arrives from a place on them."""
        del bounds
        assert places is not None
        source, normal, weight, by_area = self._draw(disc_to_square(places))
        to, square = aim(source, at)
        facing = np.maximum(-np.einsum("ij,ij->i", to, normal), 0)
        density = np.divide(by_area * square, facing, out=np.full(len(to), np.inf), where=facing > 0)
        return Arrivals(to, source, weight * (facing / square)[:, None], density)

    def meet(self, origins: Array, directions: Array) -> Meetings:
        """Return that no ray meets it: rays hit the surfaces themselves."""
        del directions
        return Meetings(np.full(len(origins), np.inf), np.zeros(origins.shape), np.zeros(len(origins)))

    def find_density(self, faces: Ints, directions: Array, distances: Array) -> Array:
        """Return the density with which `sample` draws unit `directions` (n, 3) to points of `faces` (n,), (n,).

        distances: to the points, (n,). It is 0 on faces, and from sides, that do not emit.
        """
        cosines = -np.einsum("ij,ij->i", directions, self.geometry.face_normals[faces])
        chances = np.where(cosines > 0, self._chances[0, faces], self._chances[1, faces])
        area = np.maximum(self.geometry.face_areas[faces] * np.abs(cosines), np.finfo(float).tiny)
        density: Array = chances * distances**2 / area
        return density

    @cached_property
    def _chances(self) -> Array:
        """Chances of the fronts and of the backs of all faces, (2, F)."""
        chances = np.zeros((2, len(self.geometry.faces)))
        np.add.at(chances, (np.where(self.sides > 0, 0, 1), self.faces), self.chances)
        return chances

    def at(self, time: float) -> SurfaceLight:
        """Return itself: it is that of a scene at rest."""
        del time
        return self

    def translate(self, by: Vec3) -> SurfaceLight:
        """Return itself: it goes where its surfaces go."""
        del by
        return self

    def outline(self, bounds: Bounds) -> Array:
        """Return no lines: its surfaces are seen."""
        del bounds
        return np.zeros((0, 2, 3))


def find_surface_light(
    geometry: Geometry, materials: tuple[Material, ...], textures: tuple[Texture, ...]
) -> SurfaceLight | None:
    """Return the emitting surfaces of a scene as a light, None if there are none."""
    emits = np.array([material.emits and not material.unlit for material in materials], bool)
    faces = np.flatnonzero(emits[geometry.face_materials] & (geometry.face_areas > 0))
    if not len(faces):
        return None
    both = np.array([material.emits_both_sides for material in materials], bool)
    twice = faces[both[geometry.face_materials[faces]]]
    sides = np.concatenate([np.ones(len(faces), int), -np.ones(len(twice), int)])
    power = np.concatenate([_measure_power(geometry, materials, textures, part) for part in (faces, twice)])
    total = float(power.sum())
    if total <= 0:
        return None
    return SurfaceLight(geometry, materials, textures, np.concatenate([faces, twice]), sides, power / total, total)


def _measure_power(
    geometry: Geometry, materials: tuple[Material, ...], textures: tuple[Texture, ...], faces: Ints
) -> Array:
    """Return about the luminous flux over pi of one side of `faces` (m,), (m,); 0 only where nothing emits."""
    factors = np.array([material.emission for material in materials]) @ LUMINANCE
    means = np.array([_find_mean(material, textures) for material in materials])
    numbers = geometry.face_materials[faces]
    level = factors[numbers] * means[numbers]
    textured = np.array([material.emission_texture is not None for material in materials], bool)
    some = np.flatnonzero(textured[numbers])
    if len(some):
        rng, total = np.random.default_rng(0), np.zeros(len(some))
        for a, b in rng.random((PROBES, 2)):
            weights = np.tile([1 - np.sqrt(a), np.sqrt(a) * (1 - b), np.sqrt(a) * b], (len(some), 1))
            points = SurfacePoints(geometry, materials, textures, faces[some], weights)
            total += points.look_up_emission() @ LUMINANCE
        level[some] = (1 - FLOOR) * total / PROBES + FLOOR * level[some]
    power: Array = geometry.face_areas[faces] * level
    return power


def _find_mean(material: Material, textures: tuple[Texture, ...]) -> float:
    """Return the mean luminance of a material's texture of emission, 1 if it has none."""
    return (
        1.0 if material.emission_texture is None else float(textures[material.emission_texture.number].mean @ LUMINANCE)
    )
