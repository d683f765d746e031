"""Makes the built-in scene `atrium`: a two-storey courtyard with arcades, cross vaults and balustrades.

Run it as `python -m deferred_ir.scenes.atrium [OUT.glb]` (default: atrium.glb beside this file). It draws no random
numbers. Lengths are in metres: 24 along z, 12 along x, 10 high; y = 0 is the lower arcade's floor.
"""

from __future__ import annotations

import sys
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from deferred_ir.scenes import shapes
from deferred_ir.scenes.shapes import Frame, Mesh

COLORS = {
    "stone": (191, 173, 143),
    "marble": (199, 194, 184),
    "plaster": (204, 189, 163),
    "terracotta": (158, 64, 38),
    "timber": (92, 56, 31),
    "paving": (166, 153, 133),
    "slate": (46, 46, 54),
    "red": (179, 15, 13),
    "green": (18, 112, 31),
    "blue": (20, 41, 158),
}
"""Linear reflectance in 255ths: the GLB writer goes through 8 bits, which keeps these exact."""
SPECULAR = "KHR_materials_specular"

BAY = 2.4
COURT = (3.6, 9.6)
"""Half distances (x, z) of the columns' axes: 3 by 8 bays."""
OUTER = (6.0, 12.0)
WALL = 0.2
"""Half thickness of the walls that stand on the columns."""
THICK = 0.3
"""Of the outer walls."""
SINK = 0.32
GROUND = -0.8
STOREYS = ((0.0, 3.0, 5.0), (5.0, 7.35, 9.2))
"""Floor, springing and top of the arcade wall of both storeys."""
RADIUS, RISE = 0.95, 1.12
TOP = 10.0

COLUMN_BASE = (
    *((0.265, 0.14), (0.285, 0.185), (0.265, 0.23), (0.235, 0.235), (0.23, 0.28), (0.25, 0.31), (0.21, 0.34)),
)
COLUMN_CAPITAL = (*((0.17, -0.46), (0.205, -0.435), (0.17, -0.41), (0.175, -0.32), (0.205, -0.22), (0.27, -0.12)),)
BALUSTER = (
    *((0.055, 0.0), (0.055, 0.04), (0.03, 0.07), (0.06, 0.18), (0.05, 0.28), (0.028, 0.46)),
    *((0.05, 0.5), (0.03, 0.54), (0.055, 0.62)),
)
FOUNTAIN = (
    *((1.3, 0.0), (1.3, 0.12), (1.15, 0.14), (1.18, 0.45), (1.3, 0.5), (1.3, 0.56), (1.12, 0.56), (1.05, 0.3)),
    *((0.3, 0.28), (0.2, 0.36), (0.13, 0.6), (0.12, 0.9), (0.18, 1.0), (0.45, 1.08), (0.62, 1.2), (0.64, 1.26)),
    *((0.58, 1.26), (0.4, 1.18), (0.12, 1.16), (0.08, 1.3), (0.12, 1.4), (0.14, 1.5), (0.12, 1.58), (0.0, 1.64)),
)
URN = (
    *((0.16, 0.0), (0.16, 0.05), (0.1, 0.09), (0.12, 0.14), (0.24, 0.3), (0.29, 0.46), (0.27, 0.58), (0.2, 0.66)),
    *((0.19, 0.7), (0.25, 0.75), (0.25, 0.78), (0.2, 0.78), (0.17, 0.68), (0.0, 0.6)),
)

Meshes = defaultdict[str, Mesh]


def sides() -> Iterator[tuple[Frame, int, float]]:
    """The courtyard's four sides: a frame in the middle of each column axis, its bays, and the arcade's depth."""
    for axis, bays in ((0, 8), (2, 3)):
        for sign in (-1.0, 1.0):
            towards = np.zeros(3)
            towards[axis] = -sign
            yield Frame.on(towards * -COURT[axis // 2], towards), bays, OUTER[axis // 2] - COURT[axis // 2]


def shifted(frame: Frame, s: float, y: float, d: float = 0.0) -> Frame:
    """The frame with its origin moved along its own axes."""
    return Frame(frame.points(s, y, d), frame.axes)


def column(meshes: Meshes, x: float, z: float, floor: float, springing: float) -> None:
    """A column with plinth, moulded base, swelling shaft, capital and abacus."""
    height = springing - floor
    low, high = COLUMN_BASE[-1][1], height + COLUMN_CAPITAL[0][1]
    swelling = [(0.2 - 0.03 * t**2, low + (high - low) * t) for t in (0.0, 0.5, 1.0)]
    profile = [*COLUMN_BASE, *swelling, *((r, height + y) for r, y in COLUMN_CAPITAL[1:])]
    shapes.lathe(meshes["marble"], (x, floor, z), profile, 16)
    shapes.box(meshes["stone"], (x - 0.29, floor, z - 0.29), (x + 0.29, floor + 0.14, z + 0.29), "-y")
    shapes.box(meshes["stone"], (x - 0.29, springing - 0.12, z - 0.29), (x + 0.29, springing, z + 0.29))


def columns(meshes: Meshes) -> None:
    """Both storeys' columns around the courtyard."""
    for floor, springing, _ in STOREYS:
        for x in np.arange(-COURT[0], COURT[0] + 0.1, BAY):
            for z in np.arange(-COURT[1], COURT[1] + 0.1, BAY):
                if np.isclose(abs(x), COURT[0]) or np.isclose(abs(z), COURT[1]):
                    column(meshes, x, z, floor, springing)


def arcade_walls(meshes: Meshes) -> None:
    """The arched walls on the columns; the long sides take the corners, the short ones end at their faces."""
    for frame, bays, _ in sides():
        for _, springing, top in STOREYS:
            for bay in range(bays):
                ends = [-BAY / 2, BAY / 2]
                corner = WALL if bays == 8 else -WALL
                ends[0] -= corner if bay == 0 else 0
                ends[1] += corner if bay == bays - 1 else 0
                local = shifted(frame, (bay - (bays - 1) / 2) * BAY, springing)
                shapes.arch(meshes["stone"], local, RADIUS, (ends[0], ends[1]), top - springing, half=WALL)


def vaults(meshes: Meshes) -> None:
    """A cross vault over every bay of the arcades, corners included, and transverse arches between them."""
    for floor, springing, _ in STOREYS:
        for sign in (-1.0, 1.0):
            x = sorted((sign * (COURT[0] + WALL), sign * OUTER[0]))
            z = sorted((sign * (COURT[1] + WALL), sign * OUTER[1]))
            for bay in range(8):
                start = (bay - 4) * BAY
                shapes.groin_vault(meshes["plaster"], (x[0], x[1]), (start, start + BAY), springing, RISE)
            for bay in range(3):
                start = (bay - 1.5) * BAY
                shapes.groin_vault(meshes["plaster"], (start, start + BAY), (z[0], z[1]), springing, RISE)
            for other in (x, [-x[1], -x[0]]):
                shapes.groin_vault(meshes["plaster"], (other[0], other[1]), (z[0], z[1]), springing, RISE)
        for frame, bays, depth in sides():
            half = (depth - WALL) / 2
            across = Frame(frame.origin, frame.axes[[2, 1, 0]])
            for line in range(bays + 1):
                s = (line - bays / 2) * BAY
                shapes.band(
                    meshes["stone"], shifted(across, -WALL - half, springing, s), half, RISE, half=WALL, depth=0.1
                )
                pilaster(meshes, shifted(frame, s, floor, -depth), springing - floor)


def pilaster(meshes: Meshes, frame: Frame, height: float) -> None:
    """A pilaster with an impost on an outer wall, where a transverse arch comes down."""
    for half, out, low, high in ((0.2, 0.12, 0.0, height - 0.12), (0.25, 0.18, height - 0.12, height)):
        shapes.framed_box(meshes["stone"], frame, (-half, low, 0.0), (half, high, out))


def balustrades(meshes: Meshes) -> None:
    """Turned balusters between a lower and an upper rail, in each bay of the upper storey."""
    floor = STOREYS[1][0]
    for frame, bays, _ in sides():
        for bay in range(bays):
            middle = shifted(frame, (bay - (bays - 1) / 2) * BAY, floor)
            for half, low, high, without in ((0.1, 0.0, 0.1, "-y"), (0.12, 0.72, 0.82, "")):
                reach = BAY / 2 - 0.15
                shapes.framed_box(meshes["stone"], middle, (-reach, low, -half), (reach, high, half), without)
            for s in np.linspace(-0.8, 0.8, 7):
                shapes.lathe(meshes["marble"], middle.points(s, 0.1, 0.0), BALUSTER, 8)


def paved(meshes: Meshes, y: float, x: list[float], z: list[float], tile: str) -> None:
    """A floor with slate bands: x and z are breaks, and every second interval, from the second on, is slate."""
    for i in range(len(x) - 1):
        for j in range(len(z) - 1):
            material = "slate" if i % 2 or j % 2 else tile
            shapes.rectangle(meshes[material], y, (x[i], x[i + 1]), (z[j], z[j + 1]))


def bands(low: float, high: float, lines: np.ndarray, width: float) -> list[float]:
    """Breaks of a floor from low to high with slate bands of `width` along the given lines."""
    return [low, *(float(line + side) for line in lines for side in (-width / 2, width / 2)), high]


def floors(meshes: Meshes) -> None:
    """Both arcades' floors, the sunken courtyard with its steps, and mouldings; the cornice's top is the roof."""
    faces = (COURT[0] - WALL, COURT[1] - WALL)
    edge = (faces[0] - 0.2, faces[1] - 0.2)
    lines = (np.arange(9) - 4) * BAY
    inner = (edge[0] - 0.7, edge[1] - 0.7)
    court_x = bands(-inner[0], inner[0], np.array([-1.6, 1.6]), 0.3)
    paved(meshes, -SINK, court_x, bands(-inner[1], inner[1], lines[1:-1], 0.3), "paving")
    steps = [(0.0, 0.0), (0.0, -SINK / 2), (0.35, -SINK / 2), (0.35, -SINK), (0.7, -SINK)]
    shapes.sweep(meshes["marble"], edge, steps[::-1])
    for y, (x, z), tile in ((0.0, edge, "paving"), (STOREYS[1][0], faces, "terracotta")):
        for sign in (-1.0, 1.0):
            low, high = sorted((sign * x, sign * OUTER[0]))
            paved(meshes, y, [low, high], bands(-OUTER[1], OUTER[1], lines, 0.3), tile)
            low, high = sorted((sign * z, sign * OUTER[1]))
            paved(meshes, y, bands(-x, x, np.array([-BAY / 2, BAY / 2]), 0.3), [low, high], tile)
    course = [(0.0, 4.55), (0.05, 4.55), (0.05, 4.68), (0.12, 4.76), (0.12, 4.84), (0.2, 4.9), (0.2, 5.0), (0.0, 5.0)]
    shapes.sweep(meshes["marble"], faces, course)
    cornice = [(0.0, 9.0), (0.06, 9.0), (0.06, 9.16), (0.14, 9.24), (0.14, 9.4), (0.22, 9.46), (0.34, 9.7), (0.4, 9.74)]
    shapes.sweep(meshes["marble"], faces, [*cornice, (0.4, TOP), (-OUTER[0] - THICK + faces[0], TOP)])


def outer_walls(meshes: Meshes) -> None:
    """Solid outer walls and ground: terracotta inside below, plaster above, stone outside."""
    for material, low, high in (("terracotta", 0.0, STOREYS[1][0]), ("plaster", STOREYS[1][0], TOP)):
        shapes.sweep(meshes[material], OUTER, [(0.0, low), (0.0, high)])
    x, z = (length + THICK for length in OUTER)
    shapes.rectangle(meshes["stone"], GROUND, (-x, x), (-z, z), up=False)
    for sign in (-1.0, 1.0):
        for axis in (0, 2):
            towards = np.zeros(3)
            towards[axis] = sign
            frame = Frame.on(towards * (OUTER[axis // 2] + THICK), towards)
            reach = OUTER[1 - axis // 2] + THICK
            grid = frame.points(np.array([[-reach], [reach]]), np.array([GROUND, TOP]), 0.0)
            meshes["stone"].sheet(grid, towards)


def furnishings(meshes: Meshes) -> None:
    """Cloths over the balustrades, a fountain, and urns in the arcades."""
    for frame, bays, _ in sides():
        if bays != 8:
            continue
        for bay, color in ((1, "green"), (3, "red"), (5, "blue"), (6, "green")):
            top = shifted(frame, (bay - 3.5) * BAY, STOREYS[1][0] + 0.86, 0.5)
            shapes.cloth(meshes[color], top, 1.5, 2.9, 4.0)
            shapes.framed_box(meshes["timber"], top, (-0.85, 0.0, -0.03), (0.85, 0.06, 0.03))
            for s in (-0.7, 0.7):
                shapes.framed_box(meshes["timber"], top, (s - 0.03, -0.04, -0.6), (s + 0.03, 0.0, 0.1))
        for bay in range(0, 8, 2):
            shapes.lathe(meshes["terracotta"], frame.points((bay - 3.5) * BAY, 0.0, -0.2), URN, 14)
    shapes.lathe(meshes["marble"], (0.0, -SINK, -1.2), FOUNTAIN, 32)


def pergola(meshes: Meshes) -> None:
    """Timber beams across the open courtyard."""
    for z in (np.arange(16) - 7.5) * BAY / 2:
        shapes.box(meshes["timber"], (-3.5, TOP, z - 0.08), (3.5, TOP + 0.28, z + 0.08))


def build() -> dict[str, Mesh]:
    """All parts of the atrium by material name."""
    meshes: Meshes = defaultdict(Mesh)
    for part in (columns, arcade_walls, vaults, balustrades, floors, outer_walls, furnishings, pergola):
        part(meshes)
    return dict(meshes)


def write(path: Path) -> None:
    """Write the atrium as binary glTF."""
    import trimesh

    library: Any = trimesh  # partly typed only
    scene = library.Scene()
    for name, mesh in build().items():
        positions, normals, faces = mesh.arrays()
        material = library.visual.material.PBRMaterial(
            name=name, baseColorFactor=[*COLORS[name], 255], metallicFactor=0.0, roughnessFactor=1.0
        )
        visual = library.visual.TextureVisuals(material=material)
        part = library.Trimesh(positions, faces, vertex_normals=normals, visual=visual, process=False)
        scene.add_geometry(part, node_name=name, geom_name=name)
    path.write_bytes(library.exchange.gltf.export_glb(scene, include_normals=True, tree_postprocessor=make_matt))


def make_matt(document: dict[str, Any]) -> None:
    """Say in a glTF document that its materials have no gloss: in glTF, what is no metal is plastic."""
    for material in document["materials"]:
        material["extensions"] = {SPECULAR: {"specularFactor": 0.0}}
    document["extensionsUsed"] = [SPECULAR]


if __name__ == "__main__":
    write(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).with_name("atrium.glb"))
