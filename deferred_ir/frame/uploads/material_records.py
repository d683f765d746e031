"""Materials as tables that shaders read, and the defines that leave out what no material of a scene has."""

from __future__ import annotations

import numpy as np

from deferred_ir.base.arrays import Array, Ints
from deferred_ir.scene.scene import Scene
from deferred_ir.scene.surfaces.brdf import find_head_on
from deferred_ir.scene.surfaces.materials import IDENTITY, SLOTS, Material, TextureRef

COLORS, EMISSIONS, NUMBERS, LAYERS, TRANSFORMS = 1, 2, 3, 4, 5
"""Bindings of the storage buffers, as lib/surface/material.glsl and surface.glsl declare them."""


def describe_materials(scene: Scene) -> dict[str, int]:
    """Return defines: GLOSSY, EMITS, CUT and PLAIN_UVS, and whether slots have textures."""
    refs = _find_refs(scene)
    plain = all(ref.transform == IDENTITY and ref.uv_set == 0 for ref in refs)
    slots = {f"{slot.upper()}_TEXTURES": any(m.textures[slot] for m in scene.materials) for slot in SLOTS}
    found = {"GLOSSY": scene.has_gloss, "EMITS": scene.shows_emission, "CUT": scene.has_cutouts, "PLAIN_UVS": plain}
    return {name: int(value) for name, value in (found | slots).items()}


def pack_materials(scene: Scene, layers: Ints, arrays: Ints) -> dict[int, Array]:
    """Return the tables that the scene needs by their bindings, float32.

    layers, arrays: of each slot's texture, (slots, materials), see SceneTextures; an array -1 is none.
    """
    materials, refs = scene.materials, _find_refs(scene)
    tables = {COLORS: np.array([(*material.base_color, 0) for material in materials], "f4")}
    if scene.shows_emission:
        tables[EMISSIONS] = np.array([(*m.emission, m.emits_both_sides) for m in materials], "f4")
    if scene.has_gloss or any(m.normal_texture for m in materials):
        tables[NUMBERS] = np.array([_pack_numbers(material) for material in materials], "f4")
    if refs:
        tables[LAYERS] = np.where(arrays >= 0, layers, -1).T.astype("f4")
    if any(ref.transform != IDENTITY or ref.uv_set for ref in refs):
        tables[TRANSFORMS] = np.array([_pack_transform(ref) for m in materials for ref in m.textures.values()], "f4")
    return tables


def _find_refs(scene: Scene) -> list[TextureRef]:
    return [ref for material in scene.materials for ref in material.textures.values() if ref is not None]


def _pack_numbers(material: Material) -> tuple[float, ...]:
    first = material.metallic, material.roughness, material.specular, material.normal_scale
    return (*first, *find_head_on(material), 0.0)


def _pack_transform(ref: TextureRef | None) -> tuple[float, ...]:
    """Return two rows of the transform of one slot, each with a fourth number: the set of coordinates, and 0."""
    a, b, c, d, e, f = IDENTITY if ref is None else ref.transform
    return (a, b, c, 0.0 if ref is None else float(ref.uv_set), d, e, f, 0.0)
