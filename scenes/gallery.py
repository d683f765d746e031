"""Makes the built-in scene `gallery`: two rows of balls, of gold above and of plastic below, from smooth to rough.

Run it as `python -m deferred_ir.scenes.gallery [OUT.glb]` (default: gallery.glb beside this file). It draws no random
numbers. Lengths are in metres. All balls share one mesh, so the file is written here and not by a library.
"""

from __future__ import annotations

import io
import json
import struct
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from deferred_ir.base.arrays import Array
from deferred_ir.scenes import shapes
from deferred_ir.scenes.shapes import Mesh

WIDTH, HEIGHT = 5.6, 3.4
FRONT, BACK = 5.2, -2.0
"""Where the room begins and ends along z."""
ROUGHNESS = (0.0, 0.2, 0.4, 0.6, 0.8, 1.0)
RADIUS, APART = 0.34, 0.8
STEP = 0.9
"""Height of the plinth on which the upper row stands."""
ROWS = ((STEP + RADIUS, -1.2), (RADIUS, -0.1))
"""Height and z of the centres of the balls of gold and of plastic."""
RINGS = 24
TILE = 1.6
"""Metres of the floor that the texture covers."""
TONES = ((172, 160, 143), (150, 137, 120), (163, 148, 128), (138, 127, 113))
GROUT = (92, 87, 80)
SPECULAR, STRENGTH = "KHR_materials_specular", "KHR_materials_emissive_strength"


def paint_tiles(size: int = 128, tiles: int = 4, joint: int = 1) -> Array:
    """Return the floor's texture, uint8 (size, size, 3), sRGB: tiles of four tones and the joints between them."""
    number = np.arange(size) * tiles // size
    tone = (number[:, None] * 3 + number[None, :] * 2 + number[:, None] // 2) % len(TONES)
    image: Array = np.array(TONES, np.uint8)[tone]
    edge = np.arange(size) % (size // tiles) < joint
    image[edge[:, None] | edge[None, :]] = GROUT
    return image


def build_ball() -> Mesh:
    """Build a ball about the origin by a lathe, smooth all over."""
    ball = Mesh()
    angle = np.pi * np.arange(RINGS + 1) / RINGS
    profile = np.stack([RADIUS * np.sin(angle), -RADIUS * np.cos(angle)], axis=1)
    profile[[0, -1], 0] = 0.0
    turn = 2 * np.pi * np.arange(2 * RINGS + 1) / (2 * RINGS)
    turn[-1] = 0.0
    ring = np.stack([np.cos(turn), np.zeros_like(turn), np.sin(turn)], axis=-1)
    points = profile[:, None, :1] * ring + profile[:, None, 1:] * np.array([0.0, 1.0, 0.0])
    ball.sheet(points, points)
    return ball


def build_room() -> dict[str, Mesh]:
    """Build floor, walls, plinth and panel, by the names of their materials."""
    floor, walls, plinth, panel = (Mesh() for _ in range(4))
    x = (-WIDTH / 2, WIDTH / 2)
    shapes.rectangle(floor, 0.0, x, (BACK, FRONT))
    shapes.rectangle(walls, HEIGHT, x, (BACK, FRONT), up=False)
    for axis, sides in ((0, x), (2, (BACK, FRONT))):
        for side in sides:
            along, rise = (BACK, FRONT) if axis == 0 else x, (0.0, HEIGHT)
            grid = np.array([[(side, y, a) if axis == 0 else (a, y, side) for y in rise] for a in along])
            inwards = np.zeros(3)
            inwards[axis] = 1.0 if side == sides[0] else -1.0
            walls.sheet(grid, inwards)
    half = APART * len(ROUGHNESS) / 2
    shapes.box(plinth, (-half, 0.0, ROWS[0][1] - 0.5), (half, STEP, ROWS[0][1] + 0.5), without="-y")
    shapes.rectangle(panel, HEIGHT - 0.02, (-1.3, 1.3), (-1.1, -0.2), up=False)
    return {"floor": floor, "walls": walls, "plinth": plinth, "panel": panel}


@dataclass
class Document:
    """A glTF document and its one buffer."""

    table: dict[str, Any] = field(default_factory=lambda: {"asset": {"version": "2.0"}, "scene": 0})
    buffer: bytearray = field(default_factory=bytearray)

    def add(self, kind: str, **entry: Any) -> int:
        """Append to the array `kind`; returns the index."""
        entries = self.table.setdefault(kind, [])
        entries.append(entry)
        return len(entries) - 1

    def add_view(self, content: bytes, **entry: Any) -> int:
        """Append bytes to the buffer, aligned to four. Returns the index of their view."""
        start = len(self.buffer)
        self.buffer += content + bytes(-len(content) % 4)
        return self.add("bufferViews", buffer=0, byteOffset=start, byteLength=len(content), **entry)

    def add_vectors(self, values: Array) -> int:
        """Append float32 vectors (n, 2) or (n, 3). Returns the index of their accessor."""
        low, high = values.min(axis=0).tolist(), values.max(axis=0).tolist()
        view, kind = self.add_view(values.astype("<f4").tobytes(), target=34962), f"VEC{values.shape[1]}"
        return self.add(
            "accessors", bufferView=view, componentType=5126, count=len(values), type=kind, min=low, max=high
        )

    def add_mesh(self, mesh: Mesh, *, tiled: bool = False) -> dict[str, Any]:
        """Append a mesh's arrays; tiled: with texture coordinates, from above. Returns a primitive without material."""
        positions, normals, faces = mesh.arrays()
        attributes = {"POSITION": self.add_vectors(positions), "NORMAL": self.add_vectors(normals)}
        if tiled:
            attributes["TEXCOORD_0"] = self.add_vectors((positions[:, [0, 2]] / TILE).astype(np.float32))
        view = self.add_view(faces.astype("<u2").tobytes(), target=34963)
        index = self.add("accessors", bufferView=view, componentType=5123, count=faces.size, type="SCALAR")
        return {"attributes": attributes, "indices": index}

    def place(self, primitive: dict[str, Any], material: int, **node: Any) -> None:
        """Append a node that shows a primitive with a material."""
        mesh = self.add("meshes", primitives=[{**primitive, "material": material}])
        self.add("nodes", mesh=mesh, **node)

    def pack(self) -> bytes:
        """Return the document as binary glTF."""
        self.table["buffers"] = [{"byteLength": len(self.buffer)}]
        self.table["scenes"] = [{"nodes": list(range(len(self.table["nodes"])))}]
        text = json.dumps(self.table, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        chunks = struct.pack("<I4s", len(text), b"JSON") + text
        chunks += struct.pack("<I4s", len(self.buffer), b"BIN\0") + self.buffer
        return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def build() -> Document:
    """Build the document."""
    document = Document()
    document.table["extensionsUsed"] = [SPECULAR, STRENGTH]
    matt = {SPECULAR: {"specularFactor": 0.0}}

    def add_material(name: str, color: tuple[float, float, float], **entry: Any) -> int:
        rest = {"metallicFactor": 0.0, **entry.pop("reflection", {})}
        return document.add(
            "materials", name=name, pbrMetallicRoughness={"baseColorFactor": [*color, 1.0], **rest}, **entry
        )

    texture = document.add("textures", source=_add_image(document, paint_tiles()), sampler=0)
    # Without mipmaps: the reference, whose rays have no width, can be compared pixel by pixel.
    document.add("samplers", magFilter=9729, minFilter=9729, wrapS=10497, wrapT=10497)
    materials = {
        "floor": add_material(
            "floor", (1.0, 1.0, 1.0), extensions=matt, reflection={"baseColorTexture": {"index": texture}}
        ),
        "walls": add_material("walls", (0.62, 0.6, 0.57), extensions=matt),
        "plinth": add_material("plinth", (0.5, 0.48, 0.45), extensions=matt),
        "panel": add_material(
            "panel",
            (0.0, 0.0, 0.0),
            extensions={**matt, STRENGTH: {"emissiveStrength": 9.0}},
            emissiveFactor=[1.0, 0.95, 0.88],
        ),
    }
    for name, mesh in build_room().items():
        document.place(document.add_mesh(mesh, tiled=name == "floor"), materials[name], name=name)
    ball = document.add_mesh(build_ball())
    for (height, z), kind, color, metallic in zip(
        ROWS, ("gold", "plastic"), ((0.9, 0.66, 0.3), (0.05, 0.28, 0.4)), (1.0, 0.0), strict=True
    ):
        for i, roughness in enumerate(ROUGHNESS):
            name, x = f"{kind} {roughness}", APART * (i - (len(ROUGHNESS) - 1) / 2)
            reflection = {"metallicFactor": metallic, "roughnessFactor": roughness}
            number = add_material(name, color, reflection=reflection)
            document.place(ball, number, name=name, translation=[round(x, 6), round(height, 6), z])
    return document


def _add_image(document: Document, pixels: Array) -> int:
    from PIL import Image

    content = io.BytesIO()
    Image.fromarray(pixels).convert("P", palette=Image.Palette.ADAPTIVE, colors=8).save(content, "PNG", optimize=True)
    return document.add("images", bufferView=document.add_view(content.getvalue()), mimeType="image/png")


def write(path: Path) -> None:
    """Write the gallery as binary glTF."""
    path.write_bytes(build().pack())


if __name__ == "__main__":
    write(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).with_name("gallery.glb"))
