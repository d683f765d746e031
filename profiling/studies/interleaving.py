"""What interleaved sampling saves and what it costs: passes against lighting by all VPLs, and the error it adds.

    python -m deferred_ir.profiling.studies.interleaving cornell atrium -o out/interleaving

Frames of all settings take turns, so that a noisy machine disturbs them alike; times are medians on the GPU.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

from deferred_ir.base.arrays import Array
from deferred_ir.base.progress import track
from deferred_ir.engine.record import Record
from deferred_ir.engine.renderer import Renderer
from deferred_ir.loading.load import load
from deferred_ir.profiling.measure import arguments, panels
from deferred_ir.scene.scene import Scene
from deferred_ir.truth.metrics import relmse
from deferred_ir.vpls.interleaving import find_sub_buffers

SIZE = 512, 512
VPLS = 64, 256, 1024
BLOCKS = 2, 4, 8
TURNS = 5
CROP = slice(330, 458), slice(150, 278)
"""Rows and columns of the pictures: the foot of a box of `cornell`."""
HEAD = (
    *("scene", "VPLs", "n", "all VPLs, ms", "shares, ms", "filter, ms", "times faster", "more than 1/n^2, ms"),
    *("ask themselves", "relMSE", "energy"),
)


def compare(scene: Scene, vpls: int) -> list[dict[str, Any]]:
    """A row for each edge of a block: milliseconds, the share of pixels that ask all VPLs, relMSE and energy."""
    with ExitStack() as stack:
        make = {0: lambda: Renderer(SIZE)} | {
            n: lambda n=n: Renderer(SIZE, "interleaved", set={"interleave.n": n}) for n in BLOCKS
        }
        renderers = {n: stack.enter_context(new()) for n, new in make.items()}
        plans = {n: one.plan(scene, vpls, ["radiance"]) for n, one in renderers.items()}
        images = {n: one.render(scene, vpls=vpls).radiance for n, one in renderers.items()}
        records = {n: Record() for n in renderers}
        for _ in track(range(TURNS), f"{scene.name}, {vpls} VPLs"):
            for n, one in renderers.items():
                one.draw(scene, plans[n], record=records[n])
        for n, one in renderers.items():
            one.finish(records[n])
        alone = {n: int(_read(renderers[n], "gather", "count").item()) for n in BLOCKS}
        hit = _read(renderers[BLOCKS[0]], "gbuffer", "depth")[::-1, :, 0] > 0

    def ms(n: int, *passes: str) -> float:
        return sum(median(laps[name][0] for laps in records[n].laps) for name in passes)

    return [
        {
            "scene": scene.name,
            "vpls": vpls,
            "n": n,
            "all_ms": ms(0, "lighting"),
            **{name: ms(n, name) for name in ("light_shares", "gather")},
            "alone": alone[n] / hit.sum(),
            "relmse": relmse(images[n], images[0], hit)[0],
            "energy": float(images[n][hit].mean() / images[0][hit].mean()),
        }
        for n in BLOCKS
    ]


def _read(renderer: Renderer, name: str, port: str) -> Array:
    with renderer.gpu.ctx:
        array: Array = renderer.executor.resource((name, port)).read()
    return array


def table(rows: Sequence[Mapping[str, Any]]) -> str:
    """Markdown."""
    lines = [f"| {' | '.join(HEAD)} |", "|---" * len(HEAD) + "|"]
    for row in rows:
        both = row["light_shares"] + row["gather"]
        cells = [
            row["scene"],
            row["vpls"],
            row["n"],
            *(f"{row[name]:.0f}" for name in ("all_ms", "light_shares", "gather")),
        ]
        cells += [f"{row['all_ms'] / both:.1f}", f"{both - row['all_ms'] / row['n'] ** 2:.0f}"]
        cells += [f"{100 * row['alone']:.1f} %", f"{row['relmse']:.5f}", f"{row['energy']:.4f}"]
        lines.append("| " + " | ".join(map(str, cells)) + " |")
    return "\n".join(lines)


def pictures(scene: Scene, path: Path, n: int = 4) -> None:
    """A corner of the image: shares in their sub-buffers, put together, filtered, and by all VPLs."""
    with Renderer(SIZE, "interleaved", set={"interleave.n": n}, keep_all=True) as one:
        shared = one.render(scene, vpls=256).radiance
        shares = _read(one, "light_shares", "shares")[..., :3]
        albedo = _read(one, "gbuffer", "albedo")[::-1, :, :3]
    with Renderer(SIZE) as one:
        full = one.render(scene, vpls=256).radiance
        direct = one.render(scene, vpls=0).radiance
    whole = np.empty_like(shares)
    for share, (x, y, width, height) in enumerate(find_sub_buffers(SIZE, n)):
        whole[share // n :: n, share % n :: n] = shares[y : y + height, x : x + width]
    unfiltered = direct + albedo * whole[::-1] / np.pi
    white = np.quantile(full[CROP], 0.98)
    images = [shares[::-1] * 0.3 / np.pi, unfiltered[CROP], shared[CROP], full[CROP]]
    with panels(["irradiance in sub-buffers", "put together", "filtered", "all VPLs at every pixel"], path) as axes:
        for panel, image in zip(axes, images, strict=True):
            panel.imshow(np.clip(image / white, 0, 1) ** (1 / 2.2), interpolation="none")
            panel.set_axis_off()


def main() -> None:
    """Measure, draw, print."""
    chosen = arguments(__doc__).parse_args()
    chosen.output.mkdir(parents=True, exist_ok=True)
    scenes = [load(name) for name in chosen.scenes]
    pictures(scenes[0], chosen.output / "interleaving.svg")
    print(table([row for scene in scenes for vpls in VPLS for row in compare(scene, vpls)]))


if __name__ == "__main__":
    main()
