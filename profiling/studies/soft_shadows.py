"""Compare soft shadows of a disc light with ray-traced ones: width of penumbrae, and error of a picture.

    python -m deferred_ir.profiling.studies.soft_shadows -o out/soft

A straight edge hangs over a floor at several heights, and the width of its penumbra is measured in the rendered and in
the ray-traced image. Then follows a scene with objects that stand on the floor and hang over it. Writes
soft-shadows.json, soft-shadows.svg (widths) and soft-shadows-pictures.svg; needs the extra `report`.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from deferred_ir.base.arrays import Array, Bools
from deferred_ir.base.files import write_json
from deferred_ir.engine.renderer import Renderer
from deferred_ir.output.image import Image
from deferred_ir.profiling.figures import markdown, panels, picture_panels
from deferred_ir.profiling.study import command_line, run
from deferred_ir.rays.tracer import Tracer
from deferred_ir.scene.camera import Camera
from deferred_ir.scene.geometry import Geometry, Model
from deferred_ir.scene.lights.spotlight import Spotlight
from deferred_ir.scene.scene import Scene
from deferred_ir.scene.surfaces.materials import Material
from deferred_ir.truth.metrics import relmse
from deferred_ir.truth.path_tracer import PathTracer

SIZE = (256, 256)
STRIP = (512, 1)
SPP = 256
HEIGHTS = (0.01, 0.02, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8)
"""Heights of the edge over the floor, in distances of the light."""
RADIUS = 0.15
LEVELS = (0.1, 0.9)
"""A penumbra reaches from where the first fraction of the disc is visible to where the second is."""
Quad = Sequence[Sequence[float]]


def build_scene(quads: Sequence[Quad], camera: Camera, spotlight: Spotlight) -> Scene:
    """Build a grey scene of parallelograms with corners a, b, c and c - b + a."""
    corners = np.array([[a, b, c, np.add(np.subtract(c, b), a)] for a, b, c in quads], float)
    faces = np.array([[0, 1, 2], [0, 2, 3]]) + 4 * np.arange(len(quads))[:, None, None]
    return Scene(
        name="soft shadows",
        path=Path("soft shadows"),
        geometry=Geometry(
            corners.reshape(-1, 3), faces.reshape(-1, 3).astype("i4"), np.zeros(2 * len(quads), dtype="i4")
        ),
        materials=(Material("grey", (0.5, 0.5, 0.5)),),
        textures=(),
        models=(Model("soft shadows", 0, 4 * len(quads)),),
        camera=camera,
        lights=(spotlight,),
    )


def _floor(half: float) -> Quad:
    return (-half, 0, half), (half, 0, half), (half, 0, -half)


def _box(low: Sequence[float], high: Sequence[float]) -> list[Quad]:
    """Return the top and the four sides of a box that stands on the floor."""
    (x, y, z), (x2, y2, z2) = low, high
    around = [(x, z), (x2, z), (x2, z2), (x, z2)]
    pairs = zip(around, [*around[1:], around[0]], strict=True)
    sides = [((a[0], y, a[1]), (b[0], y, b[1]), (b[0], y2, b[1])) for a, b in pairs]
    return [((x, y2, z2), (x2, y2, z2), (x2, y2, z)), *sides]


def scene(radius: float = RADIUS, fov: float = 100.0) -> Scene:
    """Build a scene: a box, a post and a chip stand on the floor, and a tilted board hangs over it."""
    board = (0.15, 0.5, 0.3), (0.6, 0.8, 0.3), (0.6, 0.8, -0.35)
    standing = [
        *_box((-0.75, 0.0, -0.1), (-0.45, 0.45, 0.2)),
        *_box((-0.3, 0.0, 0.35), (-0.28, 0.5, 0.37)),
        *_box((-0.1, 0.0, -0.6), (0.1, 0.05, -0.5)),
    ]
    camera = Camera((0.2, 1.5, 2.0), (0.05, 0.1, 0.0), fov=42.0)
    return build_scene(
        [_floor(2.5), *standing, board], camera, Spotlight((0.1, 1.8, -0.3), (0, 0, 0), fov, (4.0,) * 3, radius)
    )


def edge(height: float, radius: float = RADIUS, scale: float = 1.0, fov: float = 80.0) -> Scene:
    """Build a half-plane at `height` over the floor with the light at height 1 over its edge; the camera is below it.

    All lengths are multiplied by `scale`.
    """
    quads = scale * np.array([_floor(3.0), ((-3, height, 3), (0, height, 3), (0, height, -3))])
    away = 0.5 * height
    up = 2 * np.degrees(np.arctan(_reach(height, radius) / away * STRIP[1] / STRIP[0]))
    camera = Camera((0.0, scale * away, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, -1.0), float(up))
    light = Spotlight((0.0, scale, 0.0), (0.0, 0.0, 0.0), fov, (scale**2,) * 3, scale * radius)
    return build_scene(quads.tolist(), camera, light)


def _reach(height: float, radius: float) -> float:
    """Return half the width that the camera of `edge` sees: a little more than the penumbra."""
    return 1.3 * radius * height / (1 - height) + 0.02 * height


def width(visibility: Array, height: float, radius: float = RADIUS) -> float:
    """Return the width of the penumbra in a strip (1, W) of `edge`, in distances of the light."""
    low, high = LEVELS
    inside = int(((visibility > low) & (visibility < high)).sum())
    return inside * 2 * _reach(height, radius) / STRIP[0]


class _Unoccluded(Tracer):
    """A tracer whose shadow rays meet nothing."""

    def occluded(self, origins: Array, targets: Array, *, lifted: bool = False) -> Bools:
        """Return False for all rays."""
        del targets, lifted
        return np.zeros(len(origins), bool)


def truth(scene: Scene, size: tuple[int, int], spp: int) -> tuple[Array, Array]:
    """Return direct light (H, W, 3) and its visible fraction (H, W), which is 1 where no light arrives at all."""
    direct, free = (
        PathTracer(scene, kind(scene), bounces=0).estimate(size, spp).direct for kind in (Tracer, _Unoccluded)
    )
    visible = np.divide(direct[..., 1], free[..., 1], out=np.ones(direct.shape[:2]), where=free[..., 1] > 0)
    return direct, visible


def render(scene: Scene, size: tuple[int, int], **options: Any) -> Image:
    """Render direct light; `options` are those of Renderer."""
    with Renderer(size, **options) as renderer:
        return renderer.render(scene, vpls=0)


def visibility(scene: Scene, **options: Any) -> Array:
    """Render the visible fraction of the light in a strip of `edge`, (1, W)."""
    floor = replace(scene.geometry, faces=scene.geometry.faces[:2], face_materials=scene.geometry.face_materials[:2])
    dark, lit = (render(each, STRIP, **options).radiance for each in (scene, replace(scene, geometry=floor)))
    fraction: Array = dark[..., 1] / lit[..., 1]
    return fraction


def widths() -> list[dict[str, float]]:
    """Return the width of the penumbra at each height, rendered and true."""
    rows = []
    for height in HEIGHTS:
        scene = edge(height)
        row = {"height": height, "drawn": width(visibility(scene), height)}
        rows.append(row | {"truth": width(truth(scene, STRIP, SPP)[1], height)})
    return rows


def errors(scene: Scene) -> tuple[dict[str, Any], dict[str, Array]]:
    """Return the relMSE of hard and soft shadows, in the penumbra and over all pixels, and the images compared."""
    direct, visible = truth(scene, SIZE, SPP)
    penumbra = (visible > 0.01) & (visible < 0.99)
    result: dict[str, Any] = {"penumbra": float(penumbra.mean()), "relmse": {}}
    images = {}
    for name, value in (("hard", "off"), ("soft", "pcss")):
        radiance = render(scene, SIZE, set={"lighting.soft": value}).radiance
        result["relmse"][name] = {
            "penumbra": relmse(radiance, direct, penumbra)[0],
            "all": relmse(radiance, direct)[0],
        }
        images[name] = radiance
    return result, {**images, "ray-traced": direct}


def plot(rows: Sequence[dict[str, float]], path: Path) -> None:
    """Draw widths over the height of the edge."""
    heights = [row["height"] for row in rows]
    with panels(["penumbra of a straight edge"], path, "width / distance of the light") as (panel,):
        panel.loglog(heights, [row["truth"] for row in rows], "-", color="grey", lw=3, alpha=0.5, label="ray-traced")
        panel.loglog(heights, [row["drawn"] for row in rows], "o", ms=4, label="rendered")
        panel.set_xlabel("height of the edge / distance of the light")


def report(chosen: argparse.Namespace) -> None:
    """Measure, write the files and print the tables."""
    folder, rows, (result, images) = chosen.output, widths(), errors(scene())
    write_json(folder / "soft-shadows.json", {"radius": RADIUS, "widths": rows, **result})
    plot(rows, folder / "soft-shadows.svg")
    white = float(np.quantile(images["ray-traced"], 0.99))
    picture_panels(images, white, folder / "soft-shadows-pictures.svg")
    cells = [[f"{row['height']:g}", f"{row['drawn']:.4f}", f"{row['truth']:.4f}"] for row in rows]
    print(markdown(["height", "rendered", "ray-traced"], cells))
    cells = [[name, f"{error['penumbra']:.4f}", f"{error['all']:.4f}"] for name, error in result["relmse"].items()]
    head = ["relMSE", f"penumbra, {100 * result['penumbra']:.0f} % of the pixels", "all pixels"]
    print(f"\n{markdown(head, cells)}")


def main(words: Sequence[str] | None = None) -> None:
    """Run the study."""
    run(command_line(__doc__, scenes=False, output=True), report, words)


if __name__ == "__main__":
    main()
