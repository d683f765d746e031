"""Soft shadows of a disc light against ray-traced ones: width of penumbrae, and error of a picture.

    python -m deferred_ir.profiling.studies.soft_shadows -o out/soft

A straight edge hangs over a floor at several heights, and the width of its penumbra is measured in the render and in
the truth. Then a scene with things that stand on the floor and hang over it. Writes soft-shadows.json, soft-shadows.svg
(widths) and soft-shadows-pictures.svg; needs the extra `report`.
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
from deferred_ir.profiling.measure import panels
from deferred_ir.rays.tracer import Tracer
from deferred_ir.scene.camera import Camera
from deferred_ir.scene.geometry import Geometry, Model
from deferred_ir.scene.lights.spot import Spotlight
from deferred_ir.scene.scene import Material, Scene
from deferred_ir.truth.metrics import relmse
from deferred_ir.truth.path_tracer import PathTracer

SIZE = (256, 256)
STRIP = (512, 1)
SPP = 256
HEIGHTS = (0.01, 0.02, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8)
"""Of the edge over the floor, in distances of the light."""
RADIUS = 0.15
LEVELS = (0.1, 0.9)
"""A penumbra is measured from where so much of the disc shows to where so much does."""
Quad = Sequence[Sequence[float]]


def built(quads: Sequence[Quad], camera: Camera, spotlight: Spotlight) -> Scene:
    """A grey scene of parallelograms with corners a, b, c and c - b + a."""
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
        spotlight=spotlight,
    )


def _floor(half: float) -> Quad:
    return (-half, 0, half), (half, 0, half), (half, 0, -half)


def _box(low: Sequence[float], high: Sequence[float]) -> list[Quad]:
    """The top and the four sides of a box that stands on the floor."""
    (x, y, z), (x2, y2, z2) = low, high
    around = [(x, z), (x2, z), (x2, z2), (x, z2)]
    pairs = zip(around, [*around[1:], around[0]], strict=True)
    sides = [((a[0], y, a[1]), (b[0], y, b[1]), (b[0], y2, b[1])) for a, b in pairs]
    return [((x, y2, z2), (x2, y2, z2), (x2, y2, z)), *sides]


def scene(radius: float = RADIUS, fov: float = 100.0) -> Scene:
    """A box, a post and a chip that touch the floor, and a tilted board that hangs over it."""
    board = (0.15, 0.5, 0.3), (0.6, 0.8, 0.3), (0.6, 0.8, -0.35)
    standing = [
        *_box((-0.75, 0.0, -0.1), (-0.45, 0.45, 0.2)),
        *_box((-0.3, 0.0, 0.35), (-0.28, 0.5, 0.37)),
        *_box((-0.1, 0.0, -0.6), (0.1, 0.05, -0.5)),
    ]
    camera = Camera((0.2, 1.5, 2.0), (0.05, 0.1, 0.0), fov=42.0)
    return built(
        [_floor(2.5), *standing, board], camera, Spotlight((0.1, 1.8, -0.3), (0, 0, 0), fov, (4.0,) * 3, radius)
    )


def edge(height: float, radius: float = RADIUS, scale: float = 1.0, fov: float = 80.0) -> Scene:
    """A half-plane at `height` over the floor, the light at height 1 over its edge; the camera looks from under it.

    Everything is `scale` times as large.
    """
    quads = scale * np.array([_floor(3.0), ((-3, height, 3), (0, height, 3), (0, height, -3))])
    away = 0.5 * height
    up = 2 * np.degrees(np.arctan(_reach(height, radius) / away * STRIP[1] / STRIP[0]))
    camera = Camera((0.0, scale * away, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, -1.0), float(up))
    light = Spotlight((0.0, scale, 0.0), (0.0, 0.0, 0.0), fov, (scale**2,) * 3, scale * radius)
    return built(quads.tolist(), camera, light)


def _reach(height: float, radius: float) -> float:
    """How far to both sides the camera of `edge` sees: a little more than the penumbra."""
    return 1.3 * radius * height / (1 - height) + 0.02 * height


def width(visibility: Array, height: float, radius: float = RADIUS) -> float:
    """Width of the penumbra in a strip (1, W) of `edge`, in distances of the light."""
    low, high = LEVELS
    inside = int(((visibility > low) & (visibility < high)).sum())
    return inside * 2 * _reach(height, radius) / STRIP[0]


class _NothingBetween(Tracer):
    """Rays that nothing stops on their way to the light."""

    def occluded(self, origins: Array, targets: Array, *, lifted: bool = False) -> Bools:
        """False for all."""
        del targets, lifted
        return np.zeros(len(origins), bool)


def truth(scene: Scene, size: tuple[int, int], spp: int) -> tuple[Array, Array]:
    """Direct light, (H, W, 3), and the share of it that shadows leave, (H, W); 1 where none arrives at all."""
    direct, free = (
        PathTracer(scene, kind(scene), bounces=0).estimate(size, spp).direct for kind in (Tracer, _NothingBetween)
    )
    share = np.divide(direct[..., 1], free[..., 1], out=np.ones(direct.shape[:2]), where=free[..., 1] > 0)
    return direct, share


def drawn(scene: Scene, size: tuple[int, int], **options: Any) -> Image:
    """Direct light as it is rendered; options: of Renderer."""
    with Renderer(size, **options) as renderer:
        return renderer.render(scene, vpls=0)


def shares(scene: Scene, **options: Any) -> Array:
    """The share of the light that shadows leave in a strip of `edge` as it is rendered, (1, W)."""
    floor = replace(scene.geometry, faces=scene.geometry.faces[:2], face_materials=scene.geometry.face_materials[:2])
    dark, lit = (drawn(each, STRIP, **options).radiance for each in (scene, replace(scene, geometry=floor)))
    share: Array = dark[..., 1] / lit[..., 1]
    return share


def widths() -> list[dict[str, float]]:
    """Of the penumbra at each height, rendered and true."""
    rows = []
    for height in HEIGHTS:
        scene = edge(height)
        row = {"height": height, "drawn": width(shares(scene), height)}
        rows.append(row | {"truth": width(truth(scene, STRIP, SPP)[1], height)})
    return rows


def errors(scene: Scene) -> tuple[dict[str, Any], list[Array]]:
    """relMSE of hard and of soft shadows, where a part of the disc is hidden and everywhere; and the three pictures."""
    direct, share = truth(scene, SIZE, SPP)
    penumbra = (share > 0.01) & (share < 0.99)
    told: dict[str, Any] = {"penumbra": float(penumbra.mean()), "relmse": {}}
    pictures = []
    for name, value in (("hard", "off"), ("soft", "pcss")):
        image = drawn(scene, SIZE, set={"shadow_maps.soft": value})
        told["relmse"][name] = {
            "penumbra": relmse(image.radiance, direct, penumbra)[0],
            "all": relmse(image.radiance, direct)[0],
        }
        pictures.append(image.radiance)
    return told, [*pictures, direct]


def pictures(images: Sequence[Array], path: Path) -> None:
    """Hard, soft and true shadows (H, W, 3) side by side, in sRGB, the last's 99th percentile at full brightness."""
    white = np.quantile(images[-1], 0.99)
    with panels(["hard", "soft", "ray-traced"], path) as axes:
        for panel, image in zip(axes, images, strict=True):
            panel.imshow(np.clip(image / white, 0, 1) ** (1 / 2.2), interpolation="none")
            panel.set_axis_off()


def plot(rows: Sequence[dict[str, float]], path: Path) -> None:
    """Widths over the height of the edge."""
    heights = [row["height"] for row in rows]
    with panels(["penumbra of a straight edge"], path, "width / distance of the light") as (panel,):
        panel.loglog(heights, [row["truth"] for row in rows], "-", color="grey", lw=3, alpha=0.5, label="ray-traced")
        panel.loglog(heights, [row["drawn"] for row in rows], "o", ms=4, label="rendered")
        panel.set_xlabel("height of the edge / distance of the light")


def main() -> None:
    """Measure, write, print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="DIR")
    folder = parser.parse_args().output
    folder.mkdir(parents=True, exist_ok=True)
    rows, (told, images) = widths(), errors(scene())
    write_json(folder / "soft-shadows.json", {"radius": RADIUS, "widths": rows, **told})
    plot(rows, folder / "soft-shadows.svg")
    pictures(images, folder / "soft-shadows-pictures.svg")
    print("| height | rendered | ray-traced |\n|---|---|---|")
    for row in rows:
        print(f"| {row['height']:g} | {row['drawn']:.4f} | {row['truth']:.4f} |")
    print(f"\n| relMSE | penumbra, {100 * told['penumbra']:.0f} % of the pixels | all pixels |\n|---|---|---|")
    for name, error in told["relmse"].items():
        print(f"| {name} | {error['penumbra']:.4f} | {error['all']:.4f} |")


if __name__ == "__main__":
    main()
