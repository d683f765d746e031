"""What a scene file says of materials of its models: the tables [material.NAME], by the names in the models' files."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from deferred_ir.base.arrays import Vec3
from deferred_ir.base.errors import did_you_mean, format_value
from deferred_ir.base.toml_tables import Faults, Table
from deferred_ir.scene.surfaces.materials import Material, Texture

RANGES = {
    "base_color": (0.0, 1.0),
    "metallic": (0.0, 1.0),
    "roughness": (0.0, 1.0),
    "emission": (0.0, math.inf),
    "specular": (0.0, 1.0),
    "ior": (1.0, math.inf),
    "alpha_cutoff": (0.0, math.inf),
    "normal_scale": (-math.inf, math.inf),
}
"""Least and largest number of each key, or of each of its three numbers."""
COLOURS = ("base_color", "emission")


@dataclass(frozen=True)
class MaterialOverride:
    """Values that replace those of a material, as in `Material`; None leaves what the model's file says."""

    base_color: Vec3 | None = None
    metallic: float | None = None
    roughness: float | None = None
    emission: Vec3 | None = None
    specular: float | None = None
    ior: float | None = None
    alpha_cutoff: float | None = None
    normal_scale: float | None = None

    @property
    def given(self) -> dict[str, Any]:
        """The values that are not None."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        return {name: value for name, value in values.items() if value is not None}

    def apply(self, material: Material, textures: Sequence[Texture]) -> Material:
        """Return a material with these values. textures: those that its own are numbered in.

        A value takes the place of the texture that says the same. Where an image says both metallic and roughness and
        one is given, the other is the image's mean. A matt material with metallic or roughness gets full gloss.
        """
        given = self.given
        if "base_color" in given:
            given["base_color_texture"] = None
        if "emission" in given:
            given["emission_texture"] = None
        if "metallic" in given or "roughness" in given:
            if not material.is_glossy:
                given.setdefault("specular", 1.0)
            if (image := material.metallic_roughness_texture) is not None:
                given["metallic_roughness_texture"] = None
                pixels = textures[image.number].pixels
                for name, channel in (("roughness", 1), ("metallic", 2)):
                    mean = float(pixels[..., channel].mean()) / np.iinfo(pixels.dtype).max
                    given.setdefault(name, getattr(material, name) * mean)
        return replace(material, **given)


def read_materials(root: Table) -> dict[str, MaterialOverride]:
    """Read all tables [material.NAME], by name."""
    tables = root.data.get("material", {})
    if not isinstance(tables, dict) or not all(isinstance(table, dict) for table in tables.values()):
        root.fault("material", 'must be a table for each material; write [material."NAME"] and, below it, its keys')
        return {}
    found = {}
    for name, data in tables.items():
        table = Table(root.faults, f"material.{format_name(name)}", data, tuple(RANGES))
        found[name] = MaterialOverride(**{key: _read_value(table, key) for key in RANGES if key in data})
    return found


def _read_value(table: Table, key: str) -> Any:
    """Return a value within its range; None after a fault."""
    value = table.vec3(key) if key in COLOURS else table.number(key, math.nan)
    low, high = RANGES[key]
    numbers = [] if value is None else list(value) if isinstance(value, tuple) else [value]
    if key == "ior" and value == 0:  # a mirror, by KHR_materials_ior
        return value
    if any(math.isnan(number) for number in numbers):
        return None
    if any(not low <= number <= high for number in numbers):
        span = f"{low:g} or more" if high == math.inf else f"from {low:g} to {high:g}"
        table.fault(key, f"must be {span}, not {format_value(table.data[key])}")
        return None
    return value


def check_names(faults: Faults, overrides: Iterable[str], known: Iterable[str]) -> None:
    """Note a fault for each of `overrides` that is no name of a material."""
    names = set(known)
    for name in overrides:
        if name not in names:
            faults.add(
                f"material.{format_name(name)}",
                f"no surface of the models has this material{did_you_mean(name, names)}",
            )


def format_name(name: str) -> str:
    """Return a key as TOML has it: in quotes, unless it is a plain word."""
    plain = name.isascii() and name.replace("_", "").replace("-", "").isalnum()
    return name if plain else f'"{name}"'


def merge_overrides(
    first: Mapping[str, MaterialOverride], second: Mapping[str, MaterialOverride]
) -> dict[str, MaterialOverride]:
    """Return the overrides of both; where both give a value, that of `second`."""
    nothing = MaterialOverride()
    return {name: replace(first.get(name, nothing), **second.get(name, nothing).given) for name in {**first, **second}}
