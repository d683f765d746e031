"""Prepares a glTF file for trimesh: rewrites its JSON into what that reads right, and keeps what it loses or rounds.

trimesh keeps base colours and vertex colours of bare meshes in 8 bits and one set of texture coordinates, drops the
children of nodes with a camera, and skips without a word what it does not know. Here, materials get their index as
their name, bare meshes get a material, what else vertices have becomes attributes of our own names, cameras and images
go, and what is not honoured becomes a note.
"""

from __future__ import annotations

import base64
import binascii
import json
import struct
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from deferred_ir.base.errors import SceneError, format_value
from deferred_ir.loading.asset_paths import Assets
from deferred_ir.loading.formats import gltf_checks, gltf_materials

TRIANGLES, STRIP, FLOAT = 4, 5, 5126
HONOURED = {
    *("EXT_texture_webp", "KHR_mesh_quantization"),
    *(gltf_materials.STRENGTH, gltf_materials.IOR, gltf_materials.SPECULAR),
    *(gltf_materials.UNLIT, gltf_materials.TRANSFORM),
}
ELSEWHERE = {"KHR_lights_punctual"}
"""Extensions that have notes of their own."""
COMPRESSED = {"KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_meshopt_compression"}
RENAMED = ("TEXCOORD_0", "TEXCOORD_1", "TANGENT")
"""Attributes that trimesh gets with an underscore before their names, which it keeps as they are."""
NORMALIZED = "_NORMALIZED"
"""What those end in that are integers for 0 to 1 or -1 to 1."""

Json = dict[str, Any]


@dataclass(frozen=True)
class GltfFile:
    """A glTF file prepared for trimesh: `text` (JSON) and `assets`.

    tables: its materials, textures, samplers and images, as they were; trimesh's material "3" is the one with that
    index. images: the contents of those that lie in buffers, by index.
    """

    text: bytes
    assets: Assets
    tables: Json
    images: Mapping[int, bytes]
    notes: tuple[str, ...]


def read_document(path: Path, data: bytes, root: Path | None = None) -> GltfFile:
    """Make the .gltf or .glb file `data` at `path` ready for trimesh. root: see Assets. Raises SceneError."""
    assets = Assets([path.parent], root=root)
    try:
        with tell_malformed(""):
            header, binary = _split_chunks(data) if data[:4] == b"glTF" else (data, None)
            document = json.loads(header.decode("utf-8-sig"))
            if not isinstance(document, dict):
                raise ValueError("not a JSON object")
            notes = tuple(f"{path.name}: {note}" for note in _find_notes(document))
            _refuse(document)
            tables = _prepare(document)
            buffers = _read_buffers(document, binary, assets)
            gltf_checks.check(document, buffers)
            images = _find_packed_images(tables, document, buffers)
            for index, buffer in enumerate(buffers):
                document["buffers"][index] = {"byteLength": len(buffer), "uri": f"buffer {index}"}
                assets.blobs[f"buffer {index}"] = buffer
    except SceneError as error:
        raise SceneError(f"{path}: {error}") from error
    except FileNotFoundError as error:
        raise SceneError(f"{path}: {error}; put it next to the model") from error
    return GltfFile(json.dumps(document).encode(), assets, tables, images, notes)


@contextmanager
def tell_malformed(before: str) -> Iterator[None]:
    """Turn what a value of an unexpected kind in the JSON ends in into a SceneError, which begins with `before`."""
    try:
        yield
    except (ValueError, TypeError, KeyError, IndexError, AttributeError, RecursionError, struct.error) as error:
        what = " ".join(f"{type(error).__name__}: {error}".split())
        raise SceneError(f"{before}malformed glTF ({what}); export it again") from error


def _read_buffers(document: Json, binary: bytes | None, assets: Assets) -> list[bytes]:
    """Return the contents of the document's buffers; `binary` is that of the one without a URI. A file is read once."""
    read: dict[str | None, bytes] = {} if binary is None else {None: binary}
    buffers = []
    for index, buffer in enumerate(document.get("buffers", [])):
        uri = buffer.get("uri")
        if uri not in read:
            read[uri] = read_content(f"buffers[{index}].uri", uri, assets)
        if not isinstance(buffer["byteLength"], int) or buffer["byteLength"] > len(read[uri]):
            what = f"says {format_value(buffer['byteLength'])} bytes, but has {len(read[uri])}"
            raise SceneError(f"buffers[{index}]: {what}; export it again")
        buffers.append(read[uri])
    return buffers


def read_content(where: str, uri: Any, assets: Assets) -> bytes:
    """Return the contents of a file or of a data URI. Raises SceneError, FileNotFoundError."""
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
        if "POSITION" in attributes and accessors[attributes["POSITION"]].get("normalized"):
            raise SceneError("POSITION is stored in normalised integers; export it without quantisation")


def _find_notes(document: Json) -> Iterator[str]:
    """Yield notes on what of the file is not honoured."""
    used = {*document.get("extensionsUsed", []), *document.get("extensionsRequired", [])}
    materials = document.get("materials", [])
    coats = [material.get("extensions", {}).get(gltf_materials.SPECULAR, {}) for material in materials]
    ignored = sorted(used - HONOURED - ELSEWHERE - COMPRESSED)
    if any("specularTexture" in coat or "specularColorTexture" in coat for coat in coats):
        ignored.append(f"textures of {gltf_materials.SPECULAR}")
    if ignored:
        yield f"not honoured: {', '.join(ignored)}"
    lights = "KHR_lights_punctual" in used or "KHR_lights_punctual" in document.get("extensions", {})
    if lights or document.get("cameras"):
        yield "its lights and cameras are ignored"
    if any(material.get("alphaMode") == "BLEND" for material in materials):
        yield f"transparent surfaces are cut out where they cover less than {gltf_materials.BLEND_CUTOFF:g}"
    if document.get("animations") or document.get("skins"):
        yield "animations and skins are ignored"
    if any(primitive.get("mode", TRIANGLES) not in (TRIANGLES, STRIP) for primitive in _iterate_primitives(document)):
        yield "points, lines and triangle fans are left out"


def _prepare(document: Json) -> Json:
    """Change `document` into what trimesh reads right. Returns the tables that materials are read from."""
    materials = document.setdefault("materials", [])
    if any("material" not in primitive for primitive in _iterate_primitives(document)):
        materials.append({})
    for primitive in _iterate_primitives(document):
        primitive.setdefault("material", len(materials) - 1)
        primitive["attributes"] = _rename(primitive["attributes"], document)
    tables = {"materials": list(materials)}
    tables |= {key: document.pop(key, []) for key in ("textures", "samplers", "images")}
    for index in range(len(materials)):
        materials[index] = {"name": str(index)}
    for node in document.get("nodes", []):
        node.pop("camera", None)
    if "scenes" not in document:
        nodes = document.get("nodes", [])
        children = {child for node in nodes for child in node.get("children", [])}
        document["scenes"] = [{"nodes": [index for index in range(len(nodes)) if index not in children]}]
        document.pop("scene", None)
    return tables


def _rename(attributes: Json, document: Json) -> Json:
    """Return a primitive's attributes as trimesh shall read them."""
    accessors = document.get("accessors", [])
    own = {key: index for key, index in attributes.items() if not key.startswith("_") and key not in RENAMED}
    for key in RENAMED:
        if key in attributes:
            normalized = bool(accessors[attributes[key]].get("normalized"))
            own[f"_{key}{NORMALIZED if normalized else ''}"] = attributes[key]
    return own


def _find_packed_images(tables: Json, document: Json, buffers: list[bytes]) -> dict[int, bytes]:
    """Return the contents of the images that lie in buffers, by index."""
    packed = {}
    for index, image in enumerate(tables["images"]):
        if "bufferView" in image:
            view = document["bufferViews"][image["bufferView"]]
            start = view.get("byteOffset", 0)
            packed[index] = buffers[view["buffer"]][start : start + view["byteLength"]]
    return packed
