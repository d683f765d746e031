"""glTF files in the making, and the scenes that they load as."""

from __future__ import annotations

import base64
import io
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from deferred_ir.loading import merge, models
from deferred_ir.scene.camera import Camera
from deferred_ir.scene.lights.spotlight import Spotlight
from deferred_ir.scene.scene import Scene
from deferred_ir.scene.surfaces.materials import Material

TYPES = {"float32": 5126, "uint8": 5121, "uint16": 5123, "uint32": 5125}
SHAPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}
POSITIONS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)
UVS = np.array([[0, 1], [1, 1], [0, 0]], np.float32)  # glTF's v runs down


def png(color: tuple[int, ...]) -> str:
    """A data URI of an image of one colour, of three or four numbers."""
    return image_uri(np.full((2, 2, len(color)), color, np.uint8))


def image_uri(pixels: np.ndarray) -> str:
    """A data URI of an image of 8 bits."""
    data = io.BytesIO()
    Image.fromarray(pixels).save(data, "PNG")
    return "data:image/png;base64," + base64.b64encode(data.getvalue()).decode()


class Document:
    """A glTF document in the making: one triangle in the primitives that `triangle` adds, each of its own mesh."""

    def __init__(self, **tables: Any) -> None:
        self.json: dict[str, Any] = {"asset": {"version": "2.0"}, "meshes": [], "nodes": [], "scenes": [{"nodes": []}]}
        self.json |= {"accessors": [], "bufferViews": [], **tables}
        self.data = b""

    def accessor(self, values: np.ndarray, **keys: Any) -> int:
        view = {"buffer": 0, "byteOffset": len(self.data), "byteLength": values.nbytes}
        self.data += values.tobytes() + b"\0" * (-values.nbytes % 4)
        self.json["bufferViews"].append(view)
        columns = 1 if values.ndim == 1 else values.shape[1]
        accessor = {"bufferView": len(self.json["bufferViews"]) - 1, "componentType": TYPES[values.dtype.name]}
        self.json["accessors"].append(accessor | {"count": len(values), "type": SHAPES[columns]} | keys)
        return len(self.json["accessors"]) - 1

    def triangle(
        self, primitive: dict[str, Any] | None = None, node: dict[str, Any] | None = None, **extra: int
    ) -> int:
        attributes = {"POSITION": self.accessor(POSITIONS), **extra}
        self.json["meshes"].append({"primitives": [{"attributes": attributes, **(primitive or {})}]})
        self.json["nodes"].append({"mesh": len(self.json["meshes"]) - 1, **(node or {})})
        self.json["scenes"][0]["nodes"].append(len(self.json["nodes"]) - 1)
        return len(self.json["nodes"]) - 1

    def write(self, path: Path) -> Path:
        if path.suffix == ".gltf":
            uri = "data:application/octet-stream;base64," + base64.b64encode(self.data).decode()
            path.write_text(json.dumps(self.json | {"buffers": [{"byteLength": len(self.data), "uri": uri}]}))
            return path
        text = json.dumps(self.json | {"buffers": [{"byteLength": len(self.data)}]}).encode()
        text += b" " * (-len(text) % 4)
        chunks = struct.pack("<I4s", len(text), b"JSON") + text
        chunks += struct.pack("<I4s", len(self.data), b"BIN\0") + self.data
        path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)
        return path


def load(path: Path) -> Scene:
    data = models.read(path)
    geometry, found, textures, ranges = merge.merge([(data, None)], "scene.toml")
    camera, light = Camera((0, 0, 1), (0, 0, 0)), Spotlight((0, 0, 1), (0, 0, 0))
    return Scene("test", path, geometry, found, textures, ranges, camera, light, notes=data.notes)


def load_material(folder: Path, table: dict[str, Any], **tables: Any) -> tuple[Material, Scene]:
    """The material and the scene of a triangle with both sets of texture coordinates, the second one half as large."""
    document = Document(materials=[table], **tables)
    uvs = {f"TEXCOORD_{number}": document.accessor((UVS / (1 + number)).astype(np.float32)) for number in (0, 1)}
    document.triangle({"material": 0}, **uvs)
    scene = load(document.write(folder / "m.gltf"))
    return scene.materials[0], scene


def material(factor: list[float], **more: Any) -> dict[str, Any]:
    return {"pbrMetallicRoughness": {"baseColorFactor": factor, "metallicFactor": 0}, **more}
