"""Reads from a glTF file's JSON what trimesh loses or rounds, and rewrites the rest into what trimesh reads right.

trimesh keeps base colours and vertex colours of bare meshes in 8 bits, drops the children of nodes with a camera, and
skips without a word what it does not know. Here, materials get their index as their name, bare meshes get a material,
cameras go, and what is not honoured becomes a note.
"""

from __future__ import annotations

import base64
import binascii
import json
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from deferred_ir.base.arrays import Array
from deferred_ir.base.errors import SceneError, format_value
from deferred_ir.loading.asset_paths import Assets
from deferred_ir.loading.formats import gltf_checks
from deferred_ir.loading.formats.model_format import FileImage, FileMaterial, ModelFormat, choose_plain_albedo
from deferred_ir.loading.model_data import check_albedo, check_emission
from deferred_ir.scene.surfaces.materials import Material

STRENGTH = "KHR_materials_emissive_strength"
TRIANGLES, STRIP, FLOAT, REPEAT = 4, 5, 5126, 10497
HONOURED = {"EXT_texture_webp", "KHR_mesh_quantization", STRENGTH}
ELSEWHERE = {"KHR_lights_punctual"}
"""Extensions that have notes of their own."""
COMPRESSED = {"KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_meshopt_compression"}
GLOSSY = "KHR_materials_pbrSpecularGlossiness"

Json = dict[str, Any]


@dataclass(frozen=True)
class BaseColor:
    """A glTF material's name, base colour (linear, unrounded), and the name and index of its image, if any."""

    name: str
    factor: tuple[float, ...]
    image: str | None = None
    source: int | None = None


@dataclass(frozen=True)
class Glow:
    """What a glTF material emits: factor times strength, its image's name and index, if any, and from which sides."""

    factor: tuple[float, ...] = (0.0, 0.0, 0.0)
    image: str | None = None
    source: int | None = None
    both_sides: bool = False


@dataclass(frozen=True)
class GltfFile:
    """A glTF file prepared for trimesh: `text` (JSON) and `assets`; trimesh's material "3" is materials[3] here."""

    text: bytes
    assets: Assets
    materials: tuple[BaseColor, ...]
    glows: tuple[Glow, ...]
    notes: tuple[str, ...]


class GltfFormat(ModelFormat):
    """A glTF file. Base colours and vertex colours are linear, and textures multiply them."""

    image_replaces_color = False

    def __init__(self, path: Path, data: bytes, root: Path | None) -> None:
        file = read(path, data, root)
        super().__init__(path, file.text, "gltf", file.assets)
        self.notes += file.notes
        self._materials, self._glows = file.materials, file.glows

    def read_material(self, material: Any, colored: bool) -> FileMaterial:
        """Return the file's material, whose index is the name of trimesh's."""
        if material is None:
            return FileMaterial(Material("default", choose_plain_albedo(colored)))
        base, glow = self._materials[int(material.name)], self._glows[int(material.name)]
        where = f"{self.path}: material {base.name}"
        albedo, radiance = check_albedo(base.factor, where, self.notes), check_emission(glow.factor, where)
        found = Material(base.name, albedo, emission=radiance, emits_both_sides=glow.both_sides)
        wanted = {
            "base_color": (base.image, material.baseColorTexture),
            "emission": (glow.image, material.emissiveTexture),
        }
        images = {}
        for slot, (name, image) in wanted.items():
            if name is not None and image is None:
                raise SceneError(f"{where}: image {name} is missing or not readable; put it next to the model")
            if image is not None and (name or slot == "base_color"):
                images[slot] = FileImage(image, name or "")
        return FileMaterial(found, images)

    def decode_colors(self, values: Array) -> Array:
        """Return stored colours, which are linear, cut to 1."""
        return np.clip(values, 0, 1)


def read(path: Path, data: bytes, root: Path | None = None) -> GltfFile:
    """Make the .gltf or .glb file `data` at `path` ready for trimesh. root: see Assets. Raises SceneError."""
    assets = Assets([path.parent], root=root)
    try:
        header, binary = _split_chunks(data) if data[:4] == b"glTF" else (data, None)
        document = json.loads(header.decode("utf-8-sig"))
        if not isinstance(document, dict):
            raise ValueError("not a JSON object")
        notes = tuple(f"{path.name}: {note}" for note in _find_notes(document))
        _refuse(document)
        materials, glows = _prepare(document)
        buffers = _read_buffers(document, binary, assets)
        gltf_checks.check(document, buffers)
        for index, buffer in enumerate(buffers):
            document["buffers"][index] = {"byteLength": len(buffer), "uri": f"buffer {index}"}
            assets.blobs[f"buffer {index}"] = buffer
    except SceneError as error:
        raise SceneError(f"{path}: {error}") from error
    except FileNotFoundError as error:
        raise SceneError(f"{path}: {error}; put it next to the model") from error
    except (ValueError, TypeError, KeyError, IndexError, AttributeError, RecursionError, struct.error) as error:
        # Any of these is what a value of an unexpected kind somewhere in the JSON ends in.
        what = " ".join(f"{type(error).__name__}: {error}".split())
        raise SceneError(f"{path}: malformed glTF ({what}); export it again") from error
    return GltfFile(json.dumps(document).encode(), assets, materials, glows, notes)


def _read_buffers(document: Json, binary: bytes | None, assets: Assets) -> list[bytes]:
    """Return the contents of the document's buffers; `binary` is that of the one without a URI. A file is read once."""
    read: dict[str | None, bytes] = {} if binary is None else {None: binary}
    buffers = []
    for index, buffer in enumerate(document.get("buffers", [])):
        uri = buffer.get("uri")
        if uri not in read:
            read[uri] = _read_content(f"buffers[{index}].uri", uri, assets)
        if not isinstance(buffer["byteLength"], int) or buffer["byteLength"] > len(read[uri]):
            what = f"says {format_value(buffer['byteLength'])} bytes, but has {len(read[uri])}"
            raise SceneError(f"buffers[{index}]: {what}; export it again")
        buffers.append(read[uri])
    return buffers


def _read_content(where: str, uri: Any, assets: Assets) -> bytes:
    if not isinstance(uri, str):
        raise SceneError(f"{where}: must be a name or data, not {format_value(uri)}; export it again")
    if not uri.startswith("data:"):
        return assets[uri]
    try:
        return base64.b64decode(uri.partition(";base64,")[2], validate=True)
    except binascii.Error as error:
        raise SceneError(f"{where}: its base64 is broken ({error}); export it again") from error


def _split_chunks(data: bytes) -> tuple[bytes, bytes]:
    """Return the JSON and the first binary chunk of a GLB."""
    _, version, _ = struct.unpack_from("<4sII", data)
    if version != 2:
        raise ValueError(f"GLB version {version} instead of 2")
    found: dict[bytes, bytes] = {}
    start = 12
    while start + 8 <= len(data):
        length, kind = struct.unpack_from("<I4s", data, start)
        if start + 8 + length > len(data):
            raise ValueError("the file ends in the middle of a chunk")
        found.setdefault(kind, data[start + 8 : start + 8 + length])
        start += 8 + length
    return found[b"JSON"], found.get(b"BIN\0", b"")


def _iterate_primitives(document: Json) -> Iterator[Json]:
    return (primitive for mesh in document.get("meshes", []) for primitive in mesh["primitives"])


def _refuse(document: Json) -> None:
    """Raise SceneError for geometry that trimesh would read wrong."""
    compressed = COMPRESSED & set(document.get("extensionsRequired", []))
    if compressed:
        raise SceneError(f"compressed with {', '.join(sorted(compressed))}; export it without mesh compression")
    accessors = document.get("accessors", [])
    for primitive in _iterate_primitives(document):
        attributes = primitive["attributes"]
        indices = [primitive["indices"]] if "indices" in primitive else []
        for accessor in (accessors[index] for index in [*attributes.values(), *indices]):
            if "sparse" in accessor or "bufferView" not in accessor:
                raise SceneError("has sparse or compressed accessors, which are not read yet; export it without them")
        for name in ("POSITION", "TEXCOORD_0"):
            accessor = accessors[attributes[name]] if name in attributes else {}
            if accessor.get("normalized") or (name == "TEXCOORD_0" and accessor.get("componentType", FLOAT) != FLOAT):
                raise SceneError(f"{name} is stored in normalised integers; export it without quantisation")


def _find_notes(document: Json) -> Iterator[str]:
    """Yield notes on what of the file is not honoured."""
    used = {*document.get("extensionsUsed", []), *document.get("extensionsRequired", [])}
    if ignored := used - HONOURED - ELSEWHERE - COMPRESSED:
        yield f"not honoured: {', '.join(sorted(ignored))}"
    lights = "KHR_lights_punctual" in used or "KHR_lights_punctual" in document.get("extensions", {})
    if lights or document.get("cameras"):
        yield "its lights and cameras are ignored"
    materials = document.get("materials", [])
    if any(material.get("alphaMode", "OPAQUE") != "OPAQUE" for material in materials):
        yield "transparency is ignored"
    bases = [_find_base(material) for material in materials]
    metallic = [material["pbrMetallicRoughness"] for material in materials if "pbrMetallicRoughness" in material]
    if any(factors.get("metallicFactor", 1) > 0 for factors in metallic):
        yield "metals are taken as matt surfaces of their base colour"
    textures = [base["baseColorTexture"] for base in bases if "baseColorTexture" in base]
    if any(texture.get("texCoord", 0) for texture in textures):
        yield "texture coordinates other than the first set are not honoured"
    samplers = document.get("samplers", [])
    texture_samplers = [document["textures"][texture["index"]].get("sampler") for texture in textures]
    wraps = [samplers[index] for index in texture_samplers if index is not None]
    if any(sampler.get(key, REPEAT) != REPEAT for sampler in wraps for key in ("wrapS", "wrapT")):
        yield "textures repeat, although the file wants them clamped or mirrored"
    if document.get("animations") or document.get("skins"):
        yield "animations and skins are ignored"
    if any(primitive.get("mode", TRIANGLES) not in (TRIANGLES, STRIP) for primitive in _iterate_primitives(document)):
        yield "points, lines and triangle fans are left out"


def _find_base(material: Json) -> Json:
    """Return the table that holds a material's baseColorFactor and baseColorTexture."""
    glossy = material.get("extensions", {}).get(GLOSSY)
    if glossy is not None and "pbrMetallicRoughness" not in material:
        names = (("diffuseFactor", "baseColorFactor"), ("diffuseTexture", "baseColorTexture"))
        return {new: glossy[old] for old, new in names if old in glossy}
    base: Json = material.get("pbrMetallicRoughness", {})
    return base


def _prepare(document: Json) -> tuple[tuple[BaseColor, ...], tuple[Glow, ...]]:
    """Change `document` into what trimesh reads right. Returns the base colours and the emission of its materials."""
    materials = document.setdefault("materials", [])
    bare = [primitive for primitive in _iterate_primitives(document) if "material" not in primitive]
    if bare:
        materials.append({})
    for primitive in bare:
        primitive["material"] = len(materials) - 1
    colors = [_read_base_color(document, material, index) for index, material in enumerate(materials)]
    glows = [_read_glow(document, material) for material in materials]
    wanted = {color.source for color in colors} | {glow.source for glow in glows}
    for index in range(len(document.get("images", []))):
        if index not in wanted:
            document["images"][index] = {}  # trimesh need not read images that nobody uses
    for index, material in enumerate(materials):
        base = _find_base(material)
        reduced = {"baseColorTexture": base["baseColorTexture"]} if "baseColorTexture" in base else {}
        lit = {"emissiveTexture": material["emissiveTexture"]} if glows[index].image is not None else {}
        materials[index] = {"name": str(index), "pbrMetallicRoughness": reduced, **lit}
    for node in document.get("nodes", []):
        node.pop("camera", None)
    if "scenes" not in document:
        nodes = document.get("nodes", [])
        children = {child for node in nodes for child in node.get("children", [])}
        document["scenes"] = [{"nodes": [index for index in range(len(nodes)) if index not in children]}]
        document.pop("scene", None)
    return tuple(colors), tuple(glows)


def _read_base_color(document: Json, material: Json, index: int) -> BaseColor:
    base = _find_base(material)
    factor = tuple(float(value) for value in base.get("baseColorFactor", (1.0, 1.0, 1.0)))
    if len(factor) < 3:
        raise ValueError("baseColorFactor has fewer than three numbers")
    name = str(material.get("name", index))
    if "baseColorTexture" not in base:
        return BaseColor(name, factor[:3])
    return BaseColor(name, factor[:3], *_find_image(document, base["baseColorTexture"]["index"]))


def _read_glow(document: Json, material: Json) -> Glow:
    strength = float(material.get("extensions", {}).get(STRENGTH, {}).get("emissiveStrength", 1.0))
    factor = tuple(float(value) * strength for value in material.get("emissiveFactor", (0.0, 0.0, 0.0)))
    if len(factor) != 3:
        raise ValueError("emissiveFactor has not three numbers")
    sides = bool(material.get("doubleSided", False))
    if not any(factor) or "emissiveTexture" not in material:
        return Glow(factor, both_sides=sides)
    return Glow(factor, *_find_image(document, material["emissiveTexture"]["index"]), both_sides=sides)


def _find_image(document: Json, number: int) -> tuple[str, int | None]:
    """Return the name and the index of a texture's image; None for one that no texture of its kind has."""
    texture = document["textures"][number]
    source = texture.get("extensions", {}).get("EXT_texture_webp", texture).get("source")
    if source is None:
        return f"of texture {number}", None
    uri = str(document["images"][source].get("uri", "data:"))
    return (f"number {source}" if uri.startswith("data:") else uri), source
