"""What parameters of the graph `accurate` cost and bring: rays of the near field, clamp, candidates, visibility.

    python -m deferred_ir.profiling.studies.accurate cornell colors atrium

Each row is one setting, all others as they come. Settings take turns in one process, so that what else the machine does
meets all alike. Truth is path-traced (`--spp`), or `--reference F.npz` with arrays image and hit, for one scene.
"""

from __future__ import annotations

import argparse
from contextlib import ExitStack
from dataclasses import dataclass, field
from math import sqrt
from typing import Any

import numpy as np

from deferred_ir.base.errors import Error
from deferred_ir.base.image_size import parse_size
from deferred_ir.base.progress import track
from deferred_ir.engine.record import Record
from deferred_ir.engine.renderer import Renderer
from deferred_ir.loading.load import load
from deferred_ir.scene.scene import Scene
from deferred_ir.truth.metrics import relmse
from deferred_ir.truth.reference import reference

SAMPLES = 0.25, 1.0, 4.0, 16.0
FACTORS = 0.16, 0.32, 0.64, 1.28
CANDIDATES = 1, 4, 16, 64
VISIBILITY = "maps", "rays"
TABLES = "samples", "clamp", "candidates", "visibility"
PASS = {"samples": "near_field", "candidates": "vpl"}
"""The pass whose time a table tells besides the frame's."""


@dataclass
class Run:
    """One setting: its renderer, its plan, and what was found; errors has one relMSE a seed."""

    renderer: Renderer
    plan: Any
    record: Record = field(default_factory=Record)
    errors: list[float] = field(default_factory=list)


def settings(table: str, vpls: int) -> dict[str, dict[str, Any]]:
    """What `--set` would be told, by the names of the rows."""
    tables: dict[str, dict[str, dict[str, Any]]] = {
        "samples": {f"{n:g}": {"near_field.samples": n} for n in SAMPLES},
        "clamp": {f"{f:g} / sqrt(N)": {"vpl.clamp": f / sqrt(vpls)} for f in FACTORS},
        "candidates": {f"{n}": {"vpl.candidates": n} for n in CANDIDATES},
        "visibility": {name: {"shadow_rays.visibility": name} for name in VISIBILITY},
    }
    return tables[table]


def measure(
    scene: Scene, image: np.ndarray, hit: np.ndarray, table: str, *, size: tuple[int, int], vpls: int, seeds: int
) -> dict[str, Run]:
    """Draw `seeds` frames by each setting, in turns."""
    with ExitStack() as stack:
        runs = {}
        for name, chosen in settings(table, vpls).items():
            renderer = stack.enter_context(Renderer(size, "accurate", set=chosen))
            runs[name] = Run(renderer, renderer.plan(scene, vpls, ["radiance"]))
            renderer.draw(scene, runs[name].plan, seed=seeds)  # compiles, allocates: not what a frame costs
        for seed in track(range(seeds), f"{scene.name}, {table}"):
            for run in runs.values():
                run.renderer.draw(scene, run.plan, seed=seed, record=run.record)
                run.errors.append(relmse(run.renderer.read(run.plan).radiance, image, hit)[0])
        for run in runs.values():
            run.renderer.finish(run.record)
    return runs


def row(scene: str, table: str, name: str, run: Run) -> str:
    """A line of a Markdown table; times are the least of all seeds, which other work on the machine moves least."""
    errors = f"{np.mean(run.errors):.5f} ({min(run.errors):.5f} to {max(run.errors):.5f})"
    record = run.record
    part = [f"{min(max(laps[PASS[table]]) for laps in record.laps):.0f}"] if table in PASS else []
    return " | ".join([f"| {scene}", name, errors, *part, f"{min(record.frame_ms):.0f} |"])


def main() -> None:
    """Print Markdown tables."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("scenes", nargs="+", metavar="SCENE")
    parser.add_argument("--tables", type=lambda text: text.split(","), default=list(TABLES), metavar="A,B")
    parser.add_argument("--vpls", type=int, default=256)
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--size", type=parse_size, default=(256, 256))
    parser.add_argument("--spp", type=int, default=1024)
    parser.add_argument("--reference", metavar="F.npz")
    chosen = parser.parse_args()
    if unknown := set(chosen.tables) - set(TABLES):
        parser.error(f"--tables: no '{min(unknown)}'; there are {', '.join(TABLES)}")
    try:
        report(chosen)
    except Error as error:
        raise SystemExit(str(error)) from None


def report(chosen: argparse.Namespace) -> None:
    """A table for each of the choices, a row for each scene and setting."""
    truths = {}
    for name in chosen.scenes:
        scene = load(name)
        if chosen.reference:
            given = np.load(chosen.reference)
            truths[name] = scene, given["image"], given["hit"]
        else:
            traced = reference(scene, chosen.size, spp=chosen.spp)
            truths[name] = scene, traced.radiance, traced.hit
    for table in chosen.tables:
        part = [f"{PASS[table]}, ms"] if table in PASS else []
        head = ["scene", table, "relMSE", *part, "frame, ms"]
        print(f"\n| {' | '.join(head)} |\n" + "|---" * len(head) + "|")
        for scene, image, hit in truths.values():
            runs = measure(scene, image, hit, table, size=chosen.size, vpls=chosen.vpls, seeds=chosen.seeds)
            for name, run in runs.items():
                print(row(scene.name, table, name, run), flush=True)


if __name__ == "__main__":
    main()
