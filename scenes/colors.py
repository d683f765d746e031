"""Makes the built-in scene `colors`: writes colors.obj and colors.png.

Run it as `python -m deferred_ir.scenes.colors [FOLDER]` (default: this folder). It draws no random numbers.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from deferred_ir.base.arrays import Array

WIDTH, HEIGHT, DEPTH = 5.0, 2.8, 7.5
"""Of the room, in metres. The texture covers 5 m x 5 m of the floor, so that it repeats half once more along z."""

PATCHES = (
    (((222, 40, 34), (244, 72, 52)), ((30, 84, 224), (52, 118, 248))),
    (((246, 192, 24), (255, 222, 64)), ((26, 172, 66), (64, 206, 88))),
)
"""sRGB of the texture's quarters, top row first; each is a checker of two tones."""


def texture(size: int = 512, squares: int = 4) -> np.ndarray:
    """The floor's texture, uint8 (size, size, 3), sRGB, top row first; `squares` along the side of each quarter."""
    half = np.arange(size) * 2 // size
    square = np.arange(size) * 2 * squares // size
    tone = (square[:, None] + square[None, :]) % 2
    tones: np.ndarray = np.array(PATCHES, dtype=np.uint8)[half[:, None], half[None, :], tone]
    return tones


def sphere(center: tuple[float, float, float], radius: float, rings: int = 40) -> tuple[Array, Array, list[list[int]]]:
    """A sphere of `rings` by 2 `rings` quads, triangles at its poles: positions (V, 3), normals (V, 3), faces."""
    around = 2 * rings
    theta = np.pi * np.arange(1, rings) / rings
    phi = 2 * np.pi * np.arange(around) / around
    belt = np.stack(
        [
            np.outer(np.sin(theta), np.cos(phi)),
            np.outer(np.cos(theta), np.ones(around)),
            np.outer(np.sin(theta), -np.sin(phi)),
        ],
        axis=-1,
    )
    normals = np.concatenate([[[0.0, 1.0, 0.0]], belt.reshape(-1, 3), [[0.0, -1.0, 0.0]]])
    faces = []
    for i in range(around):
        j = (i + 1) % around
        faces.append([0, 1 + i, 1 + j])
        for ring in range(rings - 2):
            first = 1 + ring * around
            faces.append([first + i, first + around + i, first + around + j, first + j])
        last = 1 + (rings - 2) * around
        faces.append([last + i, len(normals) - 1, last + j])
    return np.asarray(center) + radius * normals, normals, faces


def block(center: tuple[float, float], size: tuple[float, float, float], turn: float) -> tuple[Array, list[list[int]]]:
    """A block standing on the floor, turned about y by `turn` degrees: positions (8, 3) and five quads, no bottom."""
    corners = np.array([(-1, 1), (1, 1), (1, -1), (-1, -1)]) / 2 * (size[0], size[2])
    c, s = np.cos(np.radians(turn)), np.sin(np.radians(turn))
    x, z = (corners @ np.array([[c, -s], [s, c]]).T + center).T
    positions = np.array([(x[i], y, z[i]) for y in (0.0, size[1]) for i in range(4)])
    sides = [[i, (i + 1) % 4, 4 + (i + 1) % 4, 4 + i] for i in range(4)]
    return positions, [*sides, [4, 5, 6, 7]]


def room() -> tuple[Array, list[list[int]]]:
    """The room's eight corners and its walls and ceiling, facing inwards; the floor is a quad of its own."""
    x, z = WIDTH / 2, DEPTH / 2
    corners = np.array([(cx, y, cz) for y in (0.0, HEIGHT) for cx, cz in ((-x, z), (x, z), (x, -z), (-x, -z))])
    return corners, [[7, 6, 5, 4], *([(i + 1) % 4, i, 4 + i, 4 + (i + 1) % 4] for i in range(4))]


class ObjText:
    """Collects the lines of an OBJ file; its indices run through the whole file and start at 1."""

    def __init__(self) -> None:
        self.lines = ["# Written by deferred_ir/scenes/colors.py", "mtllib colors.mtl"]
        self._count = {"v": 0, "vt": 0, "vn": 0}

    def _rows(self, kind: str, rows: Array) -> int:
        first = self._count[kind] + 1
        self._count[kind] += len(rows)
        # Adding 0 turns a negative zero into a positive one.
        self.lines += [f"{kind} " + " ".join(f"{value:.5f}" for value in row) for row in np.round(rows, 5) + 0.0]
        return first

    def add(self, name: str, material: str, positions: Array, faces: list[list[int]], **more: Array) -> None:
        """An object; `more` may hold vt (V, 2) or vn (V, 3), indexed like the positions."""
        self.lines += [f"o {name}", f"usemtl {material}"]
        v = self._rows("v", positions)
        vt = self._rows("vt", more["vt"]) if "vt" in more else None
        vn = self._rows("vn", more["vn"]) if "vn" in more else None
        for face in faces:
            corners = []
            for i in face:
                corner = str(v + i)
                if vt is not None:
                    corner += f"/{vt + i}"
                if vn is not None:
                    corner += f"//{vn + i}"
                corners.append(corner)
            self.lines.append("f " + " ".join(corners))


def model() -> str:
    """The text of colors.obj."""
    obj = ObjText()
    corners, walls = room()
    repeat = DEPTH / WIDTH
    obj.add("floor", "floor", corners[:4], [[0, 1, 2, 3]], vt=np.array([(0, 0), (1, 0), (1, repeat), (0, repeat)]))
    obj.add("walls", "white", corners, walls)
    for name, center, radius in (
        ("large_sphere", (-0.95, 0.62, -1.35), 0.62),
        ("small_sphere", (0.55, 0.36, 0.75), 0.36),
    ):
        positions, normals, faces = sphere(center, radius)
        obj.add(name, "gypsum", positions, faces, vn=normals)
    obj.add("block", "grey", *block((1.2, -1.5), (0.8, 1.5, 0.8), 28.0))
    return "\n".join(obj.lines) + "\n"


def main(folder: Path) -> None:
    """Write both files into `folder`."""
    from PIL import Image

    Image.fromarray(texture()).save(folder / "colors.png", optimize=True)
    (folder / "colors.obj").write_text(model(), encoding="ascii", newline="\n")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent)
