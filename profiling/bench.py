"""How far from the limits: passes against the least that they must do, and deferred against forward, in ratios.

    python -m deferred_ir.profiling.bench cornell atrium colors --vpls 64 --size 512x512 --turns 15

Graphs take turns frame by frame, so that a noisy machine disturbs all alike; each turn gives a ratio, and the table
has their median and quartiles. Passes are held against each other by GPU time, frames by wall time. `--only` measures
what contains a word: `--only lighting`.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from statistics import median, quantiles
from typing import Any

from tqdm import tqdm

from deferred_ir.loading import load
from deferred_ir.profiling.limits import FOLDER, LIMITS
from deferred_ir.renderer import Renderer
from deferred_ir.scene import Scene
from deferred_ir.scene_file import parse_size
from deferred_ir.timing import Record

GRAPHS = {"deferred": "deferred", "forward": "forward", **{name: FOLDER / f"{name}.toml" for name in LIMITS}}


@dataclass(frozen=True)
class Comparison:
    """How often `under` fits into `over`: each a graph and what of it, as `times` takes it."""

    name: str
    over: tuple[str, str]
    under: tuple[str, str]


COMPARISONS = (
    Comparison("lighting / projecting and comparing only", ("deferred", "lighting"), ("limit_lighting", "lighting")),
    Comparison("forward / deferred, whole frame", ("forward", "frame"), ("deferred", "frame")),
    Comparison("forward / deferred, without shadow maps", ("forward", "shading"), ("deferred", "shading")),
)


def take_turns(
    scene: Scene, graphs: Sequence[str], *, vpls: int, size: tuple[int, int], turns: int, device: str = "auto"
) -> dict[str, Record]:
    """Times of `turns` frames of each graph; every other turn goes backwards, which evens out a steady drift."""
    records = {graph: Record() for graph in graphs}
    with ExitStack() as stack:
        renderers = {
            graph: stack.enter_context(Renderer(size, GRAPHS[graph], device, passes=LIMITS)) for graph in graphs
        }
        plans = {graph: renderer.plan(scene, vpls, ["radiance"]) for graph, renderer in renderers.items()}
        for graph, renderer in renderers.items():
            renderer.draw(scene, plans[graph])
        for turn in tqdm(range(turns), desc=scene.name, disable=None):
            for graph in graphs if turn % 2 == 0 else reversed(graphs):
                renderers[graph].draw(scene, plans[graph], seed=turn, record=records[graph])
        for graph, renderer in renderers.items():
            renderer.finish(records[graph])
    return records


def times(record: Record, what: str) -> list[float]:
    """Milliseconds of each frame: wall time of the `frame`, or without its shadow maps, or GPU time of a pass."""
    if what == "frame":
        return record.frame_ms
    if what == "shading":
        return [frame - laps["shadow_maps"][0] for frame, laps in zip(record.frame_ms, record.laps, strict=True)]
    return [laps[what][0] for laps in record.laps]


def ratios(records: Mapping[str, Record], comparison: Comparison) -> list[float]:
    """The ratio in each turn."""
    over, under = (times(records[graph], what) for graph, what in (comparison.over, comparison.under))
    return [a / b for a, b in zip(over, under, strict=True)]


def spread(values: Sequence[float]) -> str:
    """Median and quartiles with three digits."""
    low, _, high = quantiles(values, n=4, method="inclusive")
    return f"{digits(median(values))} ({digits(low)} to {digits(high)})"


def digits(value: float) -> str:
    """Three significant digits, never as a power of ten."""
    return f"{value:.0f}" if value >= 99.95 else f"{value:#.3g}"


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A Markdown table."""
    return "\n".join("| " + " | ".join(row) + " |" for row in (head, ["---"] * len(head), *rows))


def measure(names: Sequence[str], comparisons: Sequence[Comparison], **options: Any) -> str:
    """The table of `comparisons` on these scenes; medians in milliseconds go to the standard error."""
    columns = []
    for name in names:
        scene = load(name)
        used = {graph for comparison in comparisons for graph, _ in (comparison.over, comparison.under)}
        records = take_turns(scene, [graph for graph in GRAPHS if graph in used], **options)
        for comparison in comparisons:
            over, under = (median(times(records[g], what)) for g, what in (comparison.over, comparison.under))
            print(f"{scene.name}: {comparison.name}: {over:.1f} / {under:.1f} ms", file=sys.stderr)
        columns.append([scene.name, *(spread(ratios(records, comparison)) for comparison in comparisons)])
    head, *rows = zip(["", *(comparison.name for comparison in comparisons)], *columns, strict=True)
    return table(head, rows)


def main() -> None:
    """Print a Markdown table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("scenes", nargs="+", metavar="SCENE")
    parser.add_argument("--vpls", type=int, default=64)
    parser.add_argument("--size", type=parse_size, default=(512, 512))
    parser.add_argument("--turns", type=int, default=15, choices=range(2, 1000), metavar="N")
    parser.add_argument("--device", default="auto")
    parser.add_argument("--only", default="", metavar="WORD")
    chosen = parser.parse_args()
    comparisons = [comparison for comparison in COMPARISONS if chosen.only in comparison.name]
    if not comparisons:
        parser.error(f"--only {chosen.only}: in none of: {'; '.join(c.name for c in COMPARISONS)}")
    options = {"vpls": chosen.vpls, "size": chosen.size, "turns": chosen.turns, "device": chosen.device}
    print(measure(chosen.scenes, comparisons, **options))


if __name__ == "__main__":
    main()
