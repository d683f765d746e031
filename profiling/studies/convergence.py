"""Measure error against time where frames with fresh samples are averaged, beside peers.

    python -m deferred_ir.profiling.studies.convergence cornell -o out/convergence --graphs deferred,accurate --vpls 256

A graph may have settings, as in `accurate:interleave.n=1`. The folder may be one of `deferred-ir profile`: its
reference, mask and peers' points are used, and missing ones are made. Errors are of the pixels without an edge inside,
as in the tables of equal error.
"""

from __future__ import annotations

import argparse
import shlex
import sys
import time as clock
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from deferred_ir.base.files import write_json
from deferred_ir.base.progress import progress_bar, track
from deferred_ir.engine.accumulation import Accumulation
from deferred_ir.engine.renderer import Renderer
from deferred_ir.engine.settings import parse_settings
from deferred_ir.loading.load import load
from deferred_ir.profiling.figures import markdown, panels
from deferred_ir.profiling.peers import ladder
from deferred_ir.profiling.study import command_line, run
from deferred_ir.profiling.sweep import edge_mask, reference
from deferred_ir.profiling.sweep.edge_mask import Mask
from deferred_ir.profiling.sweep.equal_error import TARGETS, Rung, group_rungs, reach
from deferred_ir.profiling.sweep.reference import Truth
from deferred_ir.report.origin import describe_run
from deferred_ir.scene.scene import Scene
from deferred_ir.truth.metrics import masked_relmse

FRAMES = 1, 4, 16, 64
Line = list[tuple[int, float, float]]
"""A graph's points: (frames, milliseconds for all of them, relMSE)."""


def measure(scene: Scene, graph: str, *, size: tuple[int, int], vpls: int, truth: Truth, mask: Mask) -> Line:
    """Return time and error after each number of FRAMES."""
    points: Line = []
    name, settings = _parse_graph(graph)
    with Renderer(size, name, set=settings) as renderer:
        plan = renderer.plan(scene, vpls, ["radiance"])
        renderer.draw(scene, plan, seed=1)  # compiles and allocates: is not measured
        mean = Accumulation(renderer, scene, plan)
        spent = 0.0
        for frame in track(range(1, FRAMES[-1] + 1), f"{scene.name}, {graph}"):
            start = clock.perf_counter()
            mean.draw()
            spent += clock.perf_counter() - start
            if frame in FRAMES:
                error = masked_relmse(mean.image().radiance, truth.radiance, mask.counts)
                points.append((frame, spent * 1e3, float("nan") if error is None else error))
    return points


def _parse_graph(text: str) -> tuple[str, dict[str, Any]]:
    """Return name and settings of `name:pass.parameter=value:...`."""
    name, *settings = text.split(":")
    return name, parse_settings(settings)


def plot(title: str, lines: Mapping[str, Line], peers: Sequence[Rung], path: Path) -> None:
    """Draw relMSE over time, log-log; the numbers are frames, and for peers paths a pixel."""
    with panels([title], path, "relMSE (trimmed, no edge pixels)") as (panel,):
        for graph, points in lines.items():
            panel.loglog([ms for _, ms, _ in points], [error for *_, error in points], "o-", ms=4, label=graph)
            for frames, ms, error in points:
                panel.annotate(f"{frames}", (ms, error), (4, 4), textcoords="offset points", size=7)
        for peer in dict.fromkeys(rung.peer for rung in peers):
            steps = [rung for rung in peers if rung.peer == peer]
            panel.loglog([rung.ms for rung in steps], [rung.relmse for rung in steps], "s--", ms=3, lw=1, label=peer)
        panel.set_xlabel("time [ms]")


def tables(lines: Mapping[str, Line], peers: Sequence[Rung]) -> str:
    """Return Markdown tables: error and time after each number of FRAMES, and the time for equal error."""
    rows = [[graph, *(f"{error:.5f} in {ms:.0f} ms" for _, ms, error in points)] for graph, points in lines.items()]
    choices = {graph: [(ms, error) for _, ms, error in points] for graph, points in lines.items()}
    for rung in peers:
        choices.setdefault(rung.peer, []).append((rung.ms, rung.relmse))
    equal = [[f"{target:g}", *(str(reach(name, choices[name], target)) for name in choices)] for target in TARGETS]
    first = markdown(["graph", *(f"{frames} frames" for frames in FRAMES)], rows)
    return f"{first}\n\n{markdown(['relMSE', *choices], equal)}"


def _truth(scene: Scene, chosen: argparse.Namespace) -> Truth:
    """Read the reference that is named, else load or trace one that is good enough for the averaged images."""
    if chosen.reference:
        return reference.read(chosen.reference, scene, chosen.size)
    images: list[Any] = []
    for graph in chosen.graphs:
        name, settings = _parse_graph(graph)
        with Renderer(chosen.size, name, set=settings) as renderer:
            images.append(renderer.render(scene, vpls=chosen.vpls, accumulate=FRAMES[-1]).radiance)
    sweep = {"convergence": chosen.graphs}
    with progress_bar() as bar:
        return reference.load_or_trace(chosen.output, scene, chosen.size, sweep, images=lambda: images, bar=bar)


def report(chosen: argparse.Namespace) -> None:
    """Measure, write the files and print the tables."""
    scene, folder, size = load(chosen.scene), chosen.output, chosen.size
    truth = _truth(scene, chosen)
    with progress_bar("edges") as bar:
        mask = edge_mask.load_or_find(folder, scene, size, bar.show)
    options = {"size": size, "vpls": chosen.vpls, "truth": truth, "mask": mask}
    lines = {graph: measure(scene, graph, **options) for graph in chosen.graphs}
    course = ladder.Course(scene, size, 1, truth, mask, describe_run(shlex.join(sys.orig_argv)))
    peers = group_rungs(ladder.run(course, folder, ladder.choose(chosen.peers)).points)
    write_json(folder / "convergence.json", {"vpls": chosen.vpls, "noise": truth.noise.relmse, "lines": lines})
    plot(f"{scene.name}, {chosen.vpls} VPLs a frame", lines, peers, folder / f"convergence-{scene.name}.svg")
    print(tables(lines, peers))
    if truth.noise.relmse:
        print(f"\nNoise of the reference itself: {truth.noise.relmse:.1g}.")


def main(words: Sequence[str] | None = None) -> None:
    """Run the study."""
    options = {"graphs": ["deferred", "accurate"], "vpls": 256, "size": (512, 512), "reference": None}
    parser = command_line(__doc__, scenes=False, output=True, **options)
    parser.add_argument("scene", metavar="SCENE")
    parser.add_argument("--peers", metavar="A,B|none", help="renderers to compare with")
    run(parser, report, words)


if __name__ == "__main__":
    main()
