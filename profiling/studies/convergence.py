"""Frames with fresh samples, averaged: error against time, beside peers.

    python -m deferred_ir.profiling.studies.convergence cornell -o out/convergence --graphs deferred,accurate --vpls 256

A graph may have settings, as in `accurate:interleave.n=1`. The folder may be one of `deferred-ir profile`: its
reference, mask and points of peers are taken, and those that are missing are made. Errors are of the pixels without an
edge inside, as in the tables of equal error.
"""

from __future__ import annotations

import argparse
import time as clock
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from deferred_ir.base.errors import Error
from deferred_ir.base.files import write_json
from deferred_ir.base.image_size import parse_size
from deferred_ir.base.progress import progress_bar, track
from deferred_ir.engine.accumulation import Accumulation
from deferred_ir.engine.renderer import Renderer
from deferred_ir.engine.settings import parse_settings as settings_of
from deferred_ir.loading.load import load
from deferred_ir.profiling.measure import panels
from deferred_ir.profiling.peers import ladder as peer_sweep
from deferred_ir.profiling.sweep import edge_mask, reference
from deferred_ir.profiling.sweep.edge_mask import Mask
from deferred_ir.profiling.sweep.equal_error import TARGETS, Rung, reach, rungs
from deferred_ir.profiling.sweep.reference import Truth
from deferred_ir.scene.scene import Scene
from deferred_ir.truth.metrics import masked_relmse

FRAMES = 1, 4, 16, 64
Line = list[tuple[int, float, float]]
"""Of a graph: (frames, milliseconds for all of them, relMSE)."""


def line(scene: Scene, graph: str, *, size: tuple[int, int], vpls: int, truth: Truth, mask: Mask) -> Line:
    """Time and error after 1, 4, 16 and 64 frames."""
    found: Line = []
    name, settings = _parsed(graph)
    with Renderer(size, name, set=settings) as renderer:
        plan = renderer.plan(scene, vpls, ["radiance"])
        renderer.draw(scene, plan, seed=1)  # compiles, allocates: not what a frame costs
        mean = Accumulation(renderer, scene, plan)
        spent = 0.0
        for frame in track(range(1, FRAMES[-1] + 1), f"{scene.name}, {graph}"):
            start = clock.perf_counter()
            mean.draw()
            spent += clock.perf_counter() - start
            if frame in FRAMES:
                error = masked_relmse(mean.image().radiance, truth.radiance, mask.kept)
                found.append((frame, spent * 1e3, float("nan") if error is None else error))
    return found


def _parsed(graph: str) -> tuple[str, dict[str, Any]]:
    """Name and settings of `name:pass.parameter=value:...`."""
    name, *settings = graph.split(":")
    return name, settings_of(settings)


def plot(title: str, lines: dict[str, Line], peers: Sequence[Rung], path: Path) -> None:
    """relMSE over time, log-log; numbers are frames, of peers paths a pixel."""
    with panels([title], path, "relMSE (trimmed, no edge pixels)") as (panel,):
        for graph, points in lines.items():
            panel.loglog([ms for _, ms, _ in points], [error for *_, error in points], "o-", ms=4, label=graph)
            for frames, ms, error in points:
                panel.annotate(f"{frames}", (ms, error), (4, 4), textcoords="offset points", size=7)
        for peer in dict.fromkeys(rung.peer for rung in peers):
            ladder = [rung for rung in peers if rung.peer == peer]
            panel.loglog([rung.ms for rung in ladder], [rung.relmse for rung in ladder], "s--", ms=3, lw=1, label=peer)
        panel.set_xlabel("time [ms]")


def tables(lines: dict[str, Line], peers: Sequence[Rung]) -> str:
    """Markdown: error and time after so many frames, and the time for equal error."""
    rows = ["| graph | " + " | ".join(f"{frames} frames" for frames in FRAMES) + " |", "|---" * (1 + len(FRAMES)) + "|"]
    for graph, points in lines.items():
        rows.append(f"| {graph} | " + " | ".join(f"{error:.5f} in {ms:.0f} ms" for _, ms, error in points) + " |")
    choices = {graph: [(ms, error) for _, ms, error in points] for graph, points in lines.items()}
    for rung in peers:
        choices.setdefault(rung.peer, []).append((rung.ms, rung.relmse))
    rows += ["", "| relMSE | " + " | ".join(choices) + " |", "|---" * (1 + len(choices)) + "|"]
    for target in TARGETS:
        cells = [str(reach(name, points, target)) for name, points in choices.items()]
        rows.append(f"| {target:g} | " + " | ".join(cells) + " |")
    return "\n".join(rows)


def main() -> None:
    """Measure, write, print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("scene", metavar="SCENE")
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="DIR")
    parser.add_argument("--graphs", type=lambda text: text.split(","), default=["deferred", "accurate"], metavar="A,B")
    parser.add_argument("--vpls", type=int, default=256)
    parser.add_argument("--size", type=parse_size, default=(512, 512))
    parser.add_argument("--reference", type=Path, metavar="R.npy")
    parser.add_argument("--peers", metavar="A,B|none")
    chosen = parser.parse_args()
    try:
        report(chosen, load(chosen.scene))
    except Error as error:
        raise SystemExit(str(error)) from None


def report(chosen: argparse.Namespace, scene: Scene) -> None:
    """All of it for one scene."""
    folder, size = chosen.output, chosen.size
    folder.mkdir(parents=True, exist_ok=True)

    if chosen.reference:
        truth = reference.given(chosen.reference, scene, size)
    else:
        images: list[Any] = []
        for graph in chosen.graphs:
            name, settings = _parsed(graph)
            with Renderer(size, name, set=settings) as renderer:
                images.append(renderer.render(scene, vpls=chosen.vpls, accumulate=FRAMES[-1]).radiance)
        sweep = {"convergence": chosen.graphs}
        with progress_bar() as bar:
            truth = reference.made(folder, scene, size, sweep, images=lambda: images, bar=bar)
    with progress_bar() as bar:
        bar.label("edges")
        mask = edge_mask.made(folder, scene, size, bar.show)
    lines = {graph: line(scene, graph, size=size, vpls=chosen.vpls, truth=truth, mask=mask) for graph in chosen.graphs}
    course = peer_sweep.Course(scene, size, 1, truth, mask)
    peers = rungs(peer_sweep.run(course, folder, peer_sweep.chosen(chosen.peers)).points)
    write_json(folder / "convergence.json", {"vpls": chosen.vpls, "noise": truth.noise, "lines": lines})
    plot(f"{scene.name}, {chosen.vpls} VPLs a frame", lines, peers, folder / f"convergence-{scene.name}.svg")
    print(tables(lines, peers))
    if truth.noise:
        print(f"\nNoise of the reference itself: {truth.noise:.1g}.")


if __name__ == "__main__":
    main()
