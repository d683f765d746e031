"""Reads materials, and how they read their textures, from a glTF document's JSON."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

from deferred_ir.base.arrays import Vec3
from deferred_ir.loading.model_data import check_albedo, check_emission, check_factor
from deferred_ir.scene.surfaces.materials import (
    BLACK,
    IDENTITY,
    WHITE,
    Affine,
    Filter,
    Material,
    Sampler,
    TextureRef,
    Wrap,
)

STRENGTH, IOR, SPECULAR = "KHR_materials_emissive_strength", "KHR_materials_ior", "KHR_materials_specular"
UNLIT, TRANSFORM = "KHR_materials_unlit", "KHR_texture_transform"
GLOSSINESS = "KHR_materials_pbrSpecularGlossiness"
BLEND_CUTOFF = 0.5
"""What is blended is there where it covers at least this much."""

WRAPS: dict[int, Wrap] = {10497: "repeat", 33648: "mirror", 33071: "clamp"}
MAGNIFY: dict[int, Filter] = {9728: "nearest", 9729: "linear"}
MINIFY: dict[int, tuple[Filter, Filter | None]] = {
    9728: ("nearest", None),
    9729: ("linear", None),
    9984: ("nearest", "nearest"),
    9985: ("linear", "nearest"),
    9986: ("nearest", "linear"),
    9987: ("linear", "linear"),
}
"""Within a level and between levels."""

Json = dict[str, Any]


class ImageUse(NamedTuple):
    """The name of an image, its index, None for a texture without one that is read, and how it is read."""

    name: str
    source: int | None
    use: TextureRef


@dataclass(frozen=True)
class MaterialReader:
    """Reads the materials of a document. where: the file, for messages; notes: what is not honoured."""

    document: Json
    where: str
    notes: list[str]

    def read(self, index: int) -> tuple[Material, dict[str, ImageUse]]:
        """Return a material and its images by slot. Raises SceneError where a number cannot be used."""
        table = self.document["materials"][index]
        name = str(table.get("name", index))
        where = f"{self.where}: material {name}"
        extensions = table.get("extensions", {})
        base, factor = find_base(table), self._read_base_color(table, where)
        material = Material(name, factor[0], alpha=factor[1], emits_both_sides=bool(table.get("doubleSided", False)))
        infos = {"base_color": base.get("baseColorTexture")}
        mode = table.get("alphaMode", "OPAQUE")
        if mode != "OPAQUE":
            cutoff = self._read_number(table, "alphaCutoff", 0.5, where) if mode == "MASK" else BLEND_CUTOFF
            material = replace(material, alpha_cutoff=cutoff)
        if UNLIT in extensions:
            # Its colour is what is seen, from both sides; the texture stays in its slot for its alpha alone.
            material = replace(material, base_color=BLACK, emission=factor[0], unlit=True, emits_both_sides=True)
            infos["emission"] = infos["base_color"]
            if mode == "OPAQUE":
                infos["base_color"] = None
            return material, self._find_images(infos)
        strength = float(extensions.get(STRENGTH, {}).get("emissiveStrength", 1.0))
        glow = tuple(float(value) * strength for value in table.get("emissiveFactor", BLACK))
        if len(glow) != 3:
            raise ValueError("emissiveFactor has not three numbers")
        material = replace(material, emission=check_emission(glow, where))
        if material.emits:
            infos["emission"] = table.get("emissiveTexture")
        if not is_matt(table):
            infos["metallic_roughness"] = base.get("metallicRoughnessTexture")
            material = replace(
                material,
                metallic=self._read_number(base, "metallicFactor", 1.0, where, most=1.0),
                roughness=self._read_number(base, "roughnessFactor", 1.0, where, most=1.0),
                **self._read_coat(extensions, where),
            )
        if normal := table.get("normalTexture"):
            infos["normal"] = normal
            material = replace(material, normal_scale=self._read_number(normal, "scale", 1.0, where, least=-math.inf))
        return material, self._find_images(infos)

    def _read_base_color(self, table: Json, where: str) -> tuple[Vec3, float]:
        factor = tuple(float(value) for value in find_base(table).get("baseColorFactor", (1.0, 1.0, 1.0, 1.0)))
        if len(factor) < 3:
            raise ValueError("baseColorFactor has fewer than three numbers")
        alpha = self._read_number({"baseColorFactor[3]": (*factor, 1.0)[3]}, "baseColorFactor[3]", 1.0, where, most=1.0)
        return check_albedo(factor[:3], where, self.notes), alpha

    def _read_coat(self, extensions: Json, where: str) -> dict[str, Any]:
        """Return the fields of `Material` that KHR_materials_specular and KHR_materials_ior say."""
        coat = extensions.get(SPECULAR, {})
        color = [
            self._read_number({"specularColorFactor": value}, "specularColorFactor", 1.0, where)
            for value in coat.get("specularColorFactor", WHITE)
        ]
        red, green, blue = color
        return {
            "specular": self._read_number(coat, "specularFactor", 1.0, where, most=1.0),
            "specular_color": (red, green, blue),
            "ior": self._read_number(extensions.get(IOR, {}), "ior", 1.5, where),
        }

    def _read_number(
        self, table: Json, key: str, default: float, where: str, *, least: float = 0.0, most: float = math.inf
    ) -> float:
        return check_factor(table.get(key, default), key, where, self.notes, least=least, most=most)

    def _find_images(self, infos: dict[str, Json | None]) -> dict[str, ImageUse]:
        return {slot: self._find_image(info) for slot, info in infos.items() if info is not None}

    def _find_image(self, info: Json) -> ImageUse:
        texture = self.document["textures"][info["index"]]
        transform = info.get("extensions", {}).get(TRANSFORM, {})
        uv_set = transform.get("texCoord", info.get("texCoord", 0))
        if not isinstance(uv_set, int) or uv_set < 0:
            raise ValueError(f"texCoord {uv_set!r} is no number of texture coordinates")
        samplers = self.document.get("samplers", [])
        sampler = read_sampler(samplers[texture["sampler"]] if "sampler" in texture else {})
        use = TextureRef(0, uv_set, read_transform(transform), sampler)
        source = texture.get("extensions", {}).get("EXT_texture_webp", texture).get("source")
        if source is None:
            return ImageUse(f"of texture {info['index']}", None, use)
        uri = str(self.document["images"][source].get("uri", "data:"))
        return ImageUse(f"number {source}" if uri.startswith("data:") else uri, source, use)


def is_matt(material: Json) -> bool:
    """Return whether a material says its base colour by specular-glossiness alone, of which only that is read."""
    return GLOSSINESS in material.get("extensions", {}) and "pbrMetallicRoughness" not in material


def find_base(material: Json) -> Json:
    """Return the table that holds a material's baseColorFactor and baseColorTexture."""
    if is_matt(material):
        names = (("diffuseFactor", "baseColorFactor"), ("diffuseTexture", "baseColorTexture"))
        table = material["extensions"][GLOSSINESS]
        return {new: table[old] for old, new in names if old in table}
    base: Json = material.get("pbrMetallicRoughness", {})
    return base


def read_sampler(sampler: Json) -> Sampler:
    """Return a glTF sampler; one without filters is as if there were none, but for how it wraps."""
    wrap = WRAPS[sampler.get("wrapS", 10497)], WRAPS[sampler.get("wrapT", 10497)]
    minify, mipmaps = MINIFY[sampler.get("minFilter", 9729)]
    return Sampler(wrap, MAGNIFY[sampler.get("magFilter", 9729)], minify, mipmaps)


def read_transform(transform: Json) -> Affine:
    """Return KHR_texture_transform for texture coordinates whose v runs upwards from the image's lower edge.

    glTF's v runs downwards: it scales, turns counter-clockwise as one sees it, then moves. The matrix printed in its
    specification turns the other way from its text, its examples and its implementations.
    """
    if not transform:
        return IDENTITY
    (x, y), (across, down) = transform.get("offset", (0.0, 0.0)), transform.get("scale", (1.0, 1.0))
    cosine, sine = math.cos(transform.get("rotation", 0.0)), math.sin(transform.get("rotation", 0.0))
    a, b, d, e = cosine * across, sine * down, -sine * across, cosine * down
    rows = (a, -b, b + x, -d, e, 1 - e - y)
    if not all(math.isfinite(value) for value in rows):
        raise ValueError(f"{TRANSFORM} is not finite")
    return rows
