"""How far from the limits: passes against the least that they must do, deferred against forward, and Python's share.

    python -m deferred_ir.profiling.limits.bench cornell atrium colors --vpls 64 --size 512x512 --turns 11

What is held against each other takes turns, frame by frame or process by process, so that a noisy machine disturbs
both alike; each turn gives a ratio, and the table has their median and quartiles. Passes are measured by GPU time,
frames by wall time. `--only` takes the rows whose name contains a word: `--only lighting`.
"""

from __future__ import annotations

import argparse
import os
import platform
import sys
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from statistics import median, quantiles
from typing import Any

from deferred_ir.base.errors import Error
from deferred_ir.base.image_size import parse_size
from deferred_ir.base.progress import track
from deferred_ir.engine.record import Record
from deferred_ir.engine.renderer import Renderer
from deferred_ir.gl.context import Gpu
from deferred_ir.loading.load import load
from deferred_ir.profiling.limits.host_costs import cold_start, python_time
from deferred_ir.profiling.limits.passes import FOLDER, LIMITS
from deferred_ir.profiling.measure import markdown
from deferred_ir.scene.scene import Scene

GRAPHS: Mapping[str, str | Path] = {
    **{name: name for name in ("deferred", "forward")},
    **{name: FOLDER / f"{name}.toml" for name in LIMITS},
}


@dataclass(frozen=True)
class Comparison:
    """How often `under` fits into `over`: each a graph and what of it, as `times` takes it."""

    over: tuple[str, str]
    under: tuple[str, str]


COMPARISONS = {
    "lighting / projecting and comparing alone": Comparison(("deferred", "lighting"), ("limit_lighting", "lighting")),
    "shadow maps / one plain depth buffer": Comparison(("deferred", "shadow_maps"), ("limit_maps", "shadow_maps")),
    "forward / deferred, whole frame": Comparison(("forward", "frame"), ("deferred", "frame")),
    "forward / deferred, without shadow maps": Comparison(("forward", "shading"), ("deferred", "shading")),
}
HOST: Mapping[str, Callable[..., list[float]]] = {
    "cold start / an empty context": cold_start,
    "Python's own time in a deferred frame, ms": python_time,
}


def take_turns(
    scene: Scene, graphs: Sequence[str], *, vpls: int, size: tuple[int, int], turns: int, device: str
) -> dict[str, Record]:
    """Times of `turns` frames of each graph; every other turn goes backwards, which evens out a steady drift."""
    records = {graph: Record() for graph in graphs}
    with ExitStack() as stack:
        renderers = {
            graph: stack.enter_context(Renderer(size, GRAPHS[graph], device, passes=LIMITS, keep_all=True))
            for graph in graphs
        }
        plans = {
            graph: renderer.plan(scene, vpls, [name for name in renderer.graph().outputs if name != "display"])
            for graph, renderer in renderers.items()
        }
        for graph, renderer in renderers.items():
            renderer.draw(scene, plans[graph])
        for turn in track(range(turns), scene.name):
            for graph in graphs if turn % 2 == 0 else reversed(graphs):
                renderers[graph].draw(scene, plans[graph], seed=turn, record=records[graph])
        for graph, renderer in renderers.items():
            renderer.finish(records[graph])
    return records


def times(record: Record, what: str) -> list[float]:
    """Milliseconds of each frame: wall time of the `frame`, or less its shadow maps (`shading`), or a pass's on GPU."""
    if what == "frame":
        return record.frame_ms
    if what == "shading":
        return [frame - laps["shadow_maps"][0] for frame, laps in zip(record.frame_ms, record.laps, strict=True)]
    return [laps[what][0] for laps in record.laps]


def spread(values: Sequence[float]) -> str:
    """Median and quartiles with three digits."""
    low, _, high = quantiles(values, n=4, method="inclusive")
    return f"{digits(median(values))} ({digits(low)} to {digits(high)})"


def digits(value: float) -> str:
    """Three significant digits, never as a power of ten."""
    return f"{value:.0f}" if abs(value) >= 99.95 else f"{value:#.3g}"


def column(name: str, rows: Sequence[str], **options: Any) -> list[str]:
    """The cells of a scene; the medians behind its ratios go to the standard error."""
    scene, cells = load(name), [name]
    chosen = [COMPARISONS[row] for row in rows if row in COMPARISONS]
    used = {graph for comparison in chosen for graph, _ in (comparison.over, comparison.under)}
    records = take_turns(scene, [graph for graph in GRAPHS if graph in used], **options) if used else {}
    for row in rows:
        if row in HOST:
            values = HOST[row](name, **options)
        else:
            comparison = COMPARISONS[row]
            over, under = (times(records[graph], what) for graph, what in (comparison.over, comparison.under))
            values = [a / b for a, b in zip(over, under, strict=True)]
            print(f"{name}: {row}: {median(over):.1f} / {median(under):.1f} ms", file=sys.stderr)
        cells.append(spread(values))
    return cells


def report(arguments: Sequence[str] | None = None) -> str:
    """The table in Markdown, and how it was made."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("scenes", nargs="+", metavar="SCENE")
    parser.add_argument("--vpls", type=int, default=64)
    parser.add_argument("--size", type=parse_size, default=(512, 512))
    parser.add_argument("--turns", type=int, default=11, choices=range(2, 1000), metavar="N")
    parser.add_argument("--device", default="auto")
    parser.add_argument("--only", default="", metavar="WORD", help="rows whose name contains it")
    chosen = parser.parse_args(arguments)
    rows = [row for row in (*COMPARISONS, *HOST) if chosen.only in row]
    if not rows:
        parser.error(f"--only {chosen.only}: in none of: {'; '.join((*COMPARISONS, *HOST))}")
    options = {"vpls": chosen.vpls, "size": chosen.size, "turns": chosen.turns, "device": chosen.device}
    gpu = Gpu(chosen.device)
    device = gpu.device.name
    gpu.close()
    columns = [column(name, rows, **options) for name in chosen.scenes]
    head, *body = zip(["", *rows], *columns, strict=True)
    made = (
        f"{device}; {os.cpu_count()} cores, Python {platform.python_version()}. {chosen.turns} turns with "
        f"{chosen.vpls} VPLs at {chosen.size[0]}x{chosen.size[1]}; median (quartiles)."
    )
    return f"{markdown(head, body)}\n\n{made}"


def main() -> None:
    """Print the table."""
    try:
        print(report())
    except Error as error:
        raise SystemExit(str(error)) from None


if __name__ == "__main__":
    main()
