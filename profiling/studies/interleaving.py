"""Measure what interleaved sampling saves and costs: its passes against lighting by all VPLs, and its added error.

    python -m deferred_ir.profiling.studies.interleaving cornell atrium -o out/interleaving

Frames of all settings take turns, so that a noisy machine disturbs them alike; times are medians of GPU times.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

from deferred_ir.base.arrays import Array
from deferred_ir.engine.renderer import Renderer
from deferred_ir.loading.load import load
from deferred_ir.profiling.figures import markdown, picture_panels
from deferred_ir.profiling.measure import time_frames
from deferred_ir.profiling.study import command_line, run
from deferred_ir.scene.scene import Scene
from deferred_ir.truth.metrics import relmse
from deferred_ir.vpls.interleaving import find_sub_buffers

SIZE = 512, 512
VPLS = 64, 256, 1024
BLOCKS = 2, 4, 8
TURNS = 5
CROP = slice(330, 458), slice(150, 278)
"""Rows and columns of the pictures: the foot of a box in `cornell`."""
HEAD = (
    *("scene", "VPLs", "n", "all VPLs, ms", "shares, ms", "gathering, ms", "times faster", "more than 1/n^2, ms"),
    *("lonely pixels", "relMSE", "energy"),
)


def compare(scene: Scene, vpls: int) -> list[dict[str, Any]]:
    """Return a row for each block size: times [ms], the fraction of lonely pixels, relMSE and energy."""
    with ExitStack() as stack:
        renderers = {0: stack.enter_context(Renderer(SIZE))}
        for n in BLOCKS:
            renderers[n] = stack.enter_context(Renderer(SIZE, "interleaved", set={"interleave.n": n}))
        plans = {n: one.plan(scene, vpls, ["radiance"]) for n, one in renderers.items()}
        images = {n: one.render(scene, vpls=vpls).radiance for n, one in renderers.items()}
        times = time_frames(scene, renderers, plans, TURNS, label=f"{scene.name}, {vpls} VPLs")
        lonely = {n: int(_read(renderers[n], "neighbours", "lonely_count").item()) for n in BLOCKS}
        hit = _read(renderers[BLOCKS[0]], "gbuffer", "depth")[::-1, :, 0] > 0

    def ms(n: int, name: str) -> float:
        return median(laps[name][0] for laps in times[n].laps)

    return [
        {
            "scene": scene.name,
            "vpls": vpls,
            "n": n,
            "all_ms": ms(0, "lighting"),
            "light_shares": ms(n, "light_shares"),
            "gather": ms(n, "neighbours") + ms(n, "gather"),
            "lonely": lonely[n] / hit.sum(),
            "relmse": relmse(images[n], images[0], hit)[0],
            "energy": float(images[n][hit].mean() / images[0][hit].mean()),
        }
        for n in BLOCKS
    ]


def _read(renderer: Renderer, name: str, port: str) -> Array:
    with renderer.gpu.ctx:
        array: Array = renderer.executor.resource((name, port)).read()
    return array


def cells(row: Mapping[str, Any]) -> list[str]:
    """Return the cells of HEAD."""
    both = row["light_shares"] + row["gather"]
    return [
        *(f"{row[name]}" for name in ("scene", "vpls", "n")),
        *(f"{row[name]:.0f}" for name in ("all_ms", "light_shares", "gather")),
        *(f"{row['all_ms'] / both:.1f}", f"{both - row['all_ms'] / row['n'] ** 2:.0f}"),
        *(f"{100 * row['lonely']:.1f} %", f"{row['relmse']:.5f}", f"{row['energy']:.4f}"),
    ]


def pictures(scene: Scene, path: Path, n: int = 4) -> None:
    """Draw a crop of the image: shares in their sub-buffers, put together, gathered, and lit by all VPLs."""
    with Renderer(SIZE, "interleaved", set={"interleave.n": n}, keep_all=True) as one:
        gathered = one.render(scene, vpls=256).radiance
        shares = _read(one, "light_shares", "shares")[..., :3]
        albedo = _read(one, "gbuffer", "albedo")[::-1, :, :3]
    with Renderer(SIZE) as one:
        full = one.render(scene, vpls=256).radiance
        direct = one.render(scene, vpls=0).radiance
    together = np.empty_like(shares)
    for share, (x, y, width, height) in enumerate(find_sub_buffers(SIZE, n)):
        together[share // n :: n, share % n :: n] = shares[y : y + height, x : x + width]
    unfiltered = direct + albedo * together[::-1] / np.pi
    images = {
        "irradiance in sub-buffers": shares[::-1] * 0.3 / np.pi,
        "put together": unfiltered[CROP],
        "filtered": gathered[CROP],
        "all VPLs at every pixel": full[CROP],
    }
    picture_panels(images, float(np.quantile(full[CROP], 0.98)), path)


def report(chosen: argparse.Namespace) -> None:
    """Draw pictures of the first scene, and print a row for each scene, number of VPLs and block size."""
    scenes = [load(name) for name in chosen.scenes]
    pictures(scenes[0], chosen.output / "interleaving.svg")
    print(markdown(HEAD, [cells(row) for scene in scenes for vpls in VPLS for row in compare(scene, vpls)]))


def main(words: Sequence[str] | None = None) -> None:
    """Run the study."""
    run(command_line(__doc__, output=True), report, words)


if __name__ == "__main__":
    main()
