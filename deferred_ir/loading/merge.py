"""Joins the parts of all models into the arrays of one scene."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from deferred_ir.base.arrays import Array
from deferred_ir.base.errors import SceneError
from deferred_ir.loading.model_data import ModelData, Part
from deferred_ir.scene.geometry import Geometry, Model
from deferred_ir.scene.motion import ModelMotion
from deferred_ir.scene.surfaces.materials import Material, Texture, TextureRef


def merge(
    models: Sequence[tuple[ModelData, ModelMotion | None]], file: str
) -> tuple[Geometry, tuple[Material, ...], tuple[Texture, ...], tuple[Model, ...]]:
    """Join all models to geometry, materials, textures and vertex ranges; `file` is what an error message names.

    Equal materials and equal images become one. Vertices stay in the order of models and parts; faces are sorted by
    the textures of their materials, otherwise in that order too. Raises SceneError where everything lies in one point.
    """
    materials: dict[Material, int] = {}
    textures: dict[tuple[Any, ...], tuple[int, Texture]] = {}
    parts = [part for model, _ in models for part in model.parts]
    owners = [model for model, _ in models for _ in model.parts]
    counts = [len(part.positions) for part in parts]
    starts = np.concatenate([[0], np.cumsum(counts)])
    if starts[-1] >= 2**31:
        raise SceneError(f"{file}: {starts[-1]} vertices are more than 32-bit indices reach; give smaller models")
    face_materials = []
    numbers: dict[int, int] = {}  # of textures by their ids

    def renumber(texture: TextureRef | None, owner: ModelData) -> TextureRef | None:
        if texture is None:
            return None
        own = owner.textures[texture.number]
        if id(own) not in numbers:
            key = own.pixels.shape, own.pixels.dtype.str, own.pixels.tobytes()
            numbers[id(own)] = textures.setdefault(key, (len(textures), own))[0]
        return replace(texture, number=numbers[id(own)])

    for part, owner in zip(parts, owners, strict=True):
        own = {slot: renumber(texture, owner) for slot, texture in part.material.textures.items()}
        material = part.material.with_textures(own)
        face_materials.append(np.full(len(part.faces), materials.setdefault(material, len(materials))))
    ranks = _rank(list(materials), [texture for _, texture in textures.values()])[np.concatenate(face_materials)]
    order = np.lexsort(ranks.T[::-1])
    faces = np.concatenate([part.faces + start for part, start in zip(parts, starts, strict=False)])
    ranges, first = [], 0
    for model, motion in models:
        count = sum(len(part.positions) for part in model.parts)
        ranges.append(Model(model.name, first, count, motion))
        first += count
    geometry = Geometry(
        positions=np.concatenate([part.positions for part in parts]),
        faces=faces[order].astype(np.int32),
        face_materials=np.concatenate(face_materials)[order].astype(np.int32),
        normals=_join(parts, lambda part: part.normals, np.zeros(3)),
        uvs=_join(parts, lambda part: part.uvs, np.zeros(2)),
        colors=_join(parts, lambda part: part.colors, np.ones(3)),
        second_uvs=_join(parts, lambda part: part.second_uvs, np.zeros(2)),
        tangents=_join(parts, lambda part: part.tangents, np.zeros(4)),
        moving=tuple(model for model in ranges if model.motion),
    )
    low, high = geometry.bounds
    if np.linalg.norm(high - low) <= 1e-12 * float(np.abs(geometry.bounds).max()):
        raise SceneError(f"{file}: all vertices lie in one point (to 64-bit floats); scale or move the model")
    return geometry, tuple(materials), tuple(texture for _, texture in textures.values()), tuple(ranges)


def _rank(materials: Sequence[Material], textures: Sequence[Texture]) -> Array:
    """Return the numbers that faces are sorted by, (materials, n): kinds of textures, then textures, none first.

    Of one kind are those that a draw call can read together (frame/uploads/scene_textures.py).
    """
    kinds: dict[Any, int] = {}
    ranks = []
    for material in materials:
        used = list(material.textures.values())
        kind = [
            -1
            if ref is None
            else kinds.setdefault(
                (textures[ref.number].pixels.shape[:2], textures[ref.number].pixels.dtype.str, ref.sampler), len(kinds)
            )
            for ref in used
        ]
        ranks.append([*kind, *(-1 if ref is None else ref.number for ref in used)])
    return np.array(ranks)


def _join(parts: list[Part], pick: Callable[[Part], Array | None], filler: Array) -> Array | None:
    """Join the arrays that `pick` returns for parts, float32, `filler` rows for None; None if all are None."""
    picked = [pick(part) for part in parts]
    if all(array is None for array in picked):
        return None
    rows = [
        np.tile(filler, (len(part.positions), 1)) if array is None else array
        for part, array in zip(parts, picked, strict=True)
    ]
    return np.concatenate(rows).astype(np.float32)
