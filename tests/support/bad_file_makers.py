"""Makers of broken files: a table of cases by name, to which the functions here add."""

from __future__ import annotations

import io
import json
import struct
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"
UV = "vt 0 0\nvt 1 0\nvt 0 1\n"
FACE = "f 1/1 2/2 3/3\n"
POSITIONS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32).tobytes()
INDICES = np.array([0, 1, 2, 0], np.uint16).tobytes()
TEXTURED = f"mtllib m.mtl\n{TRIANGLE}{UV}usemtl m\n{FACE}"

FILES: dict[str, Callable[[Path], Path]] = {}
PICTURES: set[str] = set()
"""Of FILES, those with faults that are mended, so that they give a picture."""


def text_file(name: str, content: str | bytes, picture: bool = False, file: str = "m.obj") -> None:
    """Add a case of one file."""

    def make(folder: Path) -> Path:
        (folder / file).write_bytes(content if isinstance(content, bytes) else content.encode())
        return folder / file

    FILES[name] = make
    if picture:
        PICTURES.add(name)


def document() -> dict[str, Any]:
    """A sound glTF document of one triangle; its binary part is POSITIONS, then INDICES."""
    return {
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5123, "count": 3, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": 36},
            {"buffer": 0, "byteOffset": 36, "byteLength": 8},
        ],
        "buffers": [{"byteLength": 44}],
    }


def glb(document: Any, binary: bytes = POSITIONS + INDICES) -> bytes:
    """A GLB of a document, or of the text of one, and its binary part."""
    text = document if isinstance(document, bytes) else json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(binary), b"BIN\0") + binary
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def gltf(name: str, change: Callable[[dict[str, Any]], Any], binary: bytes = POSITIONS + INDICES) -> None:
    """Add a case: the sound document after `change`."""
    made = document()
    change(made)
    text_file(name, glb(made, binary), file="m.glb")


def scene_file(name: str, text: str | bytes, picture: bool = False) -> None:
    """Add a case: a scene file beside a sound model."""

    def make(folder: Path) -> Path:
        (folder / "m.obj").write_text(TRIANGLE + "f 1 2 3\n")
        (folder / "scene.toml").write_bytes(text if isinstance(text, bytes) else text.encode())
        return folder / "scene.toml"

    FILES[name] = make
    if picture:
        PICTURES.add(name)


def image_file(name: str, content: bytes, image: str = "i.png") -> None:
    """Add a case: a textured triangle with this image."""

    def make(folder: Path) -> Path:
        (folder / "m.obj").write_text(TEXTURED)
        (folder / "m.mtl").write_text(f"newmtl m\nmap_Kd {image}\n")
        (folder / image).write_bytes(content)
        return folder / "m.obj"

    FILES[name] = make


def outside(name: str, uri: str) -> None:
    """Add a case: an image that is there, but outside the scene's folder."""

    def make(folder: Path) -> Path:
        (folder / "secret.png").write_bytes(png(1, 1))
        inner = folder / "scene"
        inner.mkdir()
        (inner / "m.obj").write_text(TEXTURED)
        (inner / "m.mtl").write_text(f"newmtl m\nmap_Kd {uri.format(folder=folder)}\n")
        return inner / "m.obj"

    FILES[name] = make


def chunk(kind: bytes, data: bytes) -> bytes:
    """One chunk of a PNG."""
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def png(width: int, height: int, rows: int | None = None) -> bytes:
    """A PNG that declares a size in RGB, with zeros for all rows or for fewer."""
    packer = zlib.compressobj(1)
    line = bytes(1 + 3 * width)
    packed = b"".join(packer.compress(line) for _ in range(height if rows is None else rows)) + packer.flush()
    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", packed) + chunk(b"IEND", b"")


def ply(vertices: str, faces: str, body: str, extra: str = "") -> str:
    """An ASCII PLY with these counts and this body."""
    properties = "".join(f"property float {axis}\n" for axis in "xyz")
    header = f"ply\nformat ascii 1.0\n{extra}element vertex {vertices}\n{properties}"
    return f"{header}element face {faces}\nproperty list uchar int vertex_indices\nend_header\n{body}"


def bmp(width: int, height: int) -> bytes:
    """The head of a BMP of a size, without its pixels."""
    info = struct.pack("<IiiHHIIiiII", 40, width, height, 1, 24, 0, 0, 0, 0, 0, 0)
    return b"BM" + struct.pack("<IHHI", 54, 0, 0, 54) + info


def zipped(name: str, content: bytes) -> bytes:
    """A zip with one file in it."""
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(name, content)
    return made.getvalue()


def huge_png() -> bytes:
    """A PNG that declares the largest size there can be, and has no pixels."""
    header = struct.pack(">IIBBBBB", 2**31 - 1, 2**31 - 1, 8, 2, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(b"")) + chunk(b"IEND", b"")
