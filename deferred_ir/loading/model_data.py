"""The contents of a model file, whatever its format."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from deferred_ir.base.arrays import Array, Ints, Vec3
from deferred_ir.base.errors import SceneError, format_value
from deferred_ir.scene.surfaces.materials import BLACK, Material, Texture

GREY = (0.8, 0.8, 0.8)
"""Albedo of a surface for which the file gives none."""


@dataclass(frozen=True, eq=False)
class Part:
    """One mesh of a model file, placed in the world, with one material, whose textures are numbered in its `ModelData`.

    Arrays are as in `Geometry`; texture coordinates are None without a texture that is read by them.
    """

    positions: Array
    faces: Ints
    material: Material
    normals: Array | None = None
    uvs: Array | None = None
    colors: Array | None = None
    second_uvs: Array | None = None
    tangents: Array | None = None

    def pick(self, vertices: Ints, faces: Ints) -> Part:
        """Return the part with `vertices` (n,) of its own in place of all, and `faces` (m, 3), which use these."""
        arrays = ("positions", "normals", "uvs", "colors", "second_uvs", "tangents")
        picked: dict[str, Any] = {}
        for name in arrays:
            rows = getattr(self, name)
            picked[name] = None if rows is None else rows[vertices]
        return replace(self, faces=faces, **picked)


@dataclass(frozen=True, eq=False)
class ModelData:
    """The contents of one model file: its parts in a fixed order, their textures, and notes on what is not honoured."""

    name: str
    parts: tuple[Part, ...]
    notes: tuple[str, ...]
    textures: tuple[Texture, ...] = ()


def check_emission(values: Any, where: str) -> Vec3:
    """Return a file's linear RGB as radiance: one number stands for all three.

    Raises SceneError unless all are finite numbers of 0 or more.
    """
    numbers = [float(value) for value in np.ravel(values)]
    numbers = numbers * 3 if len(numbers) == 1 else numbers[:3]
    if len(numbers) != 3 or not all(math.isfinite(value) and value >= 0 for value in numbers):
        raise SceneError(f"{where}: emission {numbers} must be three finite numbers of 0 or more; mend the file")
    red, green, blue = numbers
    return red, green, blue


def check_factor(
    value: Any, key: str, where: str, notes: list[str], *, least: float = 0.0, most: float = math.inf
) -> float:
    """Return a number of a file's material; one above `most` is cut to it, with a note.

    Raises SceneError unless it is finite and `least` or more.
    """
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if not number or not math.isfinite(value) or value < least:
        bound = "" if least == -math.inf else f" of {least:g} or more"
        raise SceneError(f"{where}: {key} {format_value(value)} must be a finite number{bound}; mend the file")
    if value > most:
        notes.append(f"{where}: {key} above {most:g} is cut to {most:g}")
    return min(float(value), most)


def darken(model: ModelData) -> ModelData:
    """Return a model none of whose surfaces emits."""

    def turn_off(part: Part) -> Part:
        material = replace(part.material, emission=BLACK, emission_texture=None, emits_both_sides=False)
        return replace(part, material=material)

    return replace(model, parts=tuple(turn_off(part) for part in model.parts))


def check_albedo(values: Any, where: str, notes: list[str]) -> Vec3:
    """Return a file's linear RGB as an albedo: one number stands for all three, and above 1 it is cut to 1 with a note.

    Raises SceneError unless all are finite numbers of 0 or more.
    """
    numbers = [float(value) for value in np.ravel(values)]
    numbers = numbers * 3 if len(numbers) == 1 else numbers[:3]
    if len(numbers) != 3 or not all(math.isfinite(value) and value >= 0 for value in numbers):
        raise SceneError(f"{where}: reflectance {numbers} must be three finite numbers of 0 or more; mend the file")
    if max(numbers) > 1:
        notes.append(f"{where}: reflectance above 1 is cut to 1")
    red, green, blue = (min(value, 1.0) for value in numbers)
    return red, green, blue
