"""Measure what parameters of the graphs `mapped` and `resampled` cost and gain.

    python -m deferred_ir.profiling.studies.parameters cornell colors atrium

Each row changes one parameter and leaves the others at their defaults. The settings take turns in one process, so that
a noisy machine disturbs them alike. The reference is path-traced (`--spp`), or `--reference F.npz` with the arrays
image and hit, for one scene.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from math import sqrt
from typing import Any

import numpy as np

from deferred_ir.base.errors import SettingError
from deferred_ir.engine.measurement import Measurement
from deferred_ir.engine.renderer import Renderer
from deferred_ir.graph.graph import Plan
from deferred_ir.loading.load import load
from deferred_ir.profiling.figures import markdown
from deferred_ir.profiling.measure import take_turns
from deferred_ir.profiling.study import command_line, read_or_trace, run
from deferred_ir.scene.scene import Scene
from deferred_ir.truth.metrics import relmse

SAMPLES = 0.25, 1.0, 4.0, 16.0
FACTORS = 0.16, 0.32, 0.64, 1.28
CANDIDATES = 1, 4, 16, 64
VISIBILITY = "maps", "rays"
TABLES = "samples", "clamp", "candidates", "visibility"
RESAMPLED: Mapping[str, tuple[str, Sequence[int]]] = {
    "scale": ("sample_pixels.scale", (1, 2, 3, 4)),
    "pool": ("vpl.candidates", (4, 16, 64, 256)),
    "entries": ("list_vpls.entries", (128, 256, 512, 1024)),
    "draws": ("choose_vpls.draws", (8, 16, 32, 64, 128)),
    "rays": ("choose_vpls.rays", (1, 2, 4, 8)),
    "steps": ("filter_samples.steps", (0, 1, 2, 3, 4)),
}
"""The parameter of `resampled` that a table changes, and its values."""
PASS = {
    "samples": "near_field",
    "candidates": "vpl",
    "scale": "sample_pixels",
    "pool": "vpl",
    "entries": "list_vpls",
    "draws": "choose_vpls",
    "rays": "trace_choices",
    "steps": "filter_samples",
}
"""The pass whose time a table shows besides the frame's."""


@dataclass
class Variant:
    """One setting and its measurements. errors: one relMSE a seed."""

    renderer: Renderer
    plan: Plan
    times: Measurement = field(default_factory=Measurement)
    errors: list[float] = field(default_factory=list)


def settings(table: str, vpls: int) -> dict[str, dict[str, Any]]:
    """Return the settings of a table's rows by the rows' names, as `--set` takes them."""
    if table in RESAMPLED:
        key, values = RESAMPLED[table]
        return {f"{value}": {key: value} for value in values}
    tables: dict[str, dict[str, dict[str, Any]]] = {
        "samples": {f"{n:g}": {"near_field.samples": n} for n in SAMPLES},
        "clamp": {f"{f:g} / sqrt(N)": {"vpl.clamp": f / sqrt(vpls)} for f in FACTORS},
        "candidates": {f"{n}": {"vpl.candidates": n} for n in CANDIDATES},
        "visibility": {name: {"shadow_rays.visibility": name} for name in VISIBILITY},
    }
    return tables[table]


def measure(scene: Scene, truth: Mapping[str, Any], table: str, chosen: argparse.Namespace) -> dict[str, Variant]:
    """Draw a frame of each seed with each setting, in turns. Returns the variants by the names of the rows."""
    with ExitStack() as stack:
        variants = {}
        for name, changed in settings(table, chosen.vpls).items():
            graph = "resampled" if table in RESAMPLED else "mapped"
            renderer = stack.enter_context(Renderer(chosen.size, graph, set=changed))
            variants[name] = Variant(renderer, renderer.plan(scene, chosen.vpls, ["radiance"]))
            renderer.draw(scene, variants[name].plan, seed=chosen.seeds)  # compiles and allocates: is not measured
        for seed, variant in take_turns(list(variants.values()), chosen.seeds, f"{scene.name}, {table}"):
            variant.renderer.draw(scene, variant.plan, seed=seed, measurement=variant.times)
            image = variant.renderer.read(variant.plan).radiance
            variant.errors.append(relmse(image, truth["image"], truth["hit"])[0])
        for variant in variants.values():
            variant.renderer.finish(variant.times)
    return variants


def row(scene: str, table: str, name: str, variant: Variant) -> Sequence[str]:
    """Return the cells of a row. Times are the least of all seeds, which other work on the machine disturbs least."""
    errors, times = variant.errors, variant.times
    cells = [scene, name, f"{np.mean(errors):.5f} ({min(errors):.5f} to {max(errors):.5f})"]
    if table in PASS:
        cells.append(f"{min(max(laps[PASS[table]]) for laps in times.laps):.0f}")
    return [*cells, f"{min(times.frame_ms):.0f}"]


def report(chosen: argparse.Namespace) -> None:
    """Print each chosen table with a row for each scene and setting."""
    known = (*TABLES, *RESAMPLED)
    if unknown := set(chosen.tables) - set(known):
        raise SettingError(f"--tables: no '{min(unknown)}'; there are {', '.join(known)}")
    scenes = [load(name) for name in chosen.scenes]
    truths = [read_or_trace(scene, chosen) for scene in scenes]
    for table in chosen.tables:
        head = ["scene", table, "relMSE", *([f"{PASS[table]}, ms"] if table in PASS else []), "frame, ms"]
        rows = []
        for scene, truth in zip(scenes, truths, strict=True):
            variants = measure(scene, truth, table, chosen)
            rows += [row(scene.name, table, name, variant) for name, variant in variants.items()]
        print(f"\n{markdown(head, rows)}", flush=True)


def main(words: Sequence[str] | None = None) -> None:
    """Run the study."""
    parser = command_line(__doc__, tables=list(TABLES), vpls=256, seeds=5, size=(256, 256), spp=1024, reference=None)
    run(parser, report, words)


if __name__ == "__main__":
    main()
