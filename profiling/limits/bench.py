"""Measure how far the renderer is from its limits: passes, deferred against forward, and Python's own time.

    python -m deferred_ir.profiling.limits.bench cornell atrium colors --vpls 64 --size 512x512 --turns 11

The two sides of a comparison take turns, frame by frame or process by process, so that a noisy machine disturbs both
alike; each turn gives a ratio, and the table shows the median and quartiles of the ratios. Passes are measured by GPU
time, frames by wall time. `--only` selects the rows whose name contains a word: `--only lighting`.
"""

from __future__ import annotations

import os
import platform
import sys
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from statistics import median, quantiles
from typing import Any

from deferred_ir.base.errors import Error
from deferred_ir.engine.measurement import Measurement
from deferred_ir.engine.renderer import Renderer
from deferred_ir.loading.load import load
from deferred_ir.profiling.figures import markdown
from deferred_ir.profiling.limits.allocations import measure_allocations
from deferred_ir.profiling.limits.host_costs import cold_start, python_time
from deferred_ir.profiling.limits.passes import FOLDER, LIMITS
from deferred_ir.profiling.limits.ray_rates import PASSES, measure_ray_rates
from deferred_ir.profiling.measure import name_device, time_frames
from deferred_ir.profiling.study import command_line
from deferred_ir.scene.scene import Scene

GRAPHS: Mapping[str, str | Path] = {
    **{name: name for name in ("deferred", "forward")},
    **{name: FOLDER / f"{name}.toml" for name in LIMITS},
}


@dataclass(frozen=True)
class Comparison:
    """A ratio of two times; each is a graph and a quantity of `times`."""

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
    "Python's own time in a deferred frame, ms": partial(python_time, graph="deferred"),
    "Python's own time in a resampled frame, ms": partial(python_time, graph="resampled"),
}
RATES = {f"rays a second, {name} / Embree alone": name for name in (*PASSES, "all three")}
"""Rows of the graph `resampled`, and the passes of `measure_ray_rates`."""
ALLOCATED = "arrays that NumPy allocates in a resampled frame, MiB"
ROWS = *COMPARISONS, *HOST, *RATES, ALLOCATED


def time_graphs(
    scene: Scene, graphs: Sequence[str], *, vpls: int, size: tuple[int, int], turns: int, device: str
) -> dict[str, Measurement]:
    """Draw `turns` frames of each graph, in turns, a new seed in each turn. Returns their measurements."""
    with ExitStack() as stack:
        renderers = {
            graph: stack.enter_context(Renderer(size, GRAPHS[graph], device, passes=LIMITS, keep_all=True))
            for graph in graphs
        }
        plans = {
            graph: renderer.plan(scene, vpls, [name for name in renderer.graph().outputs if name != "display"])
            for graph, renderer in renderers.items()
        }
        return time_frames(scene, renderers, plans, turns, label=scene.name, new_seeds=True)


def times(measured: Measurement, quantity: str) -> list[float]:
    """Return the milliseconds of each frame.

    quantity: `frame` (wall time), `shading` (wall time without the shadow maps) or a pass (GPU time).
    """
    if quantity == "frame":
        return measured.frame_ms
    if quantity == "shading":
        return [frame - laps["shadow_maps"][0] for frame, laps in zip(measured.frame_ms, measured.laps, strict=True)]
    return [laps[quantity][0] for laps in measured.laps]


def spread(values: Sequence[float]) -> str:
    """Return median and quartiles with three digits."""
    low, _, high = quantiles(values, n=4, method="inclusive")
    return f"{digits(median(values))} ({digits(low)} to {digits(high)})"


def digits(value: float) -> str:
    """Format with three significant digits, never as a power of ten."""
    return f"{value:.0f}" if abs(value) >= 99.95 else f"{value:#.3g}"


def column(name: str, rows: Sequence[str], **options: Any) -> list[str]:
    """Measure a scene. Returns its cells of the table; the medians behind its ratios go to standard error."""
    scene, cells = load(name), [name]
    chosen = [COMPARISONS[row] for row in rows if row in COMPARISONS]
    used = {graph for comparison in chosen for graph, _ in (comparison.over, comparison.under)}
    measured = time_graphs(scene, [graph for graph in GRAPHS if graph in used], **options) if used else {}
    rates = measure_ray_rates(name, **options) if RATES.keys() & set(rows) else {}
    for row in rows:
        if row == ALLOCATED:
            cells.append(list_allocations(name, **options))
            continue
        if row in HOST:
            values = HOST[row](name, **options)
        elif row in RATES:
            values, millions = rates[RATES[row]]
            print(f"{name}: {row}: {millions:.3f} million rays", file=sys.stderr)
        else:
            sides = COMPARISONS[row].over, COMPARISONS[row].under
            over, under = (times(measured[graph], quantity) for graph, quantity in sides)
            values = [a / b for a, b in zip(over, under, strict=True)]
            print(f"{name}: {row}: {median(over):.1f} / {median(under):.1f} ms", file=sys.stderr)
        cells.append(spread(values))
    return cells


def list_allocations(name: str, **options: Any) -> str:
    """Return the MiB that NumPy allocates in a frame, and of each pass that allocates a twentieth of it or more."""
    del options["turns"]
    found = measure_allocations(name, "resampled", **options)
    total = sum(found.values())
    parts = [f"{step} {digits(size / 2**20)}" for step, size in found.items() if step and 20 * size >= total]
    return f"{digits(total / 2**20)}: {', '.join(parts)}"


def report(words: Sequence[str] | None = None) -> str:
    """Measure what the command line asks for. Returns the table in Markdown, and a line on how it was measured."""
    parser = command_line(__doc__, vpls=64, size=(512, 512), device="auto")
    parser.add_argument("--turns", type=int, default=11, choices=range(2, 1000), metavar="N")
    parser.add_argument("--only", default="", metavar="WORD", help="rows whose name contains it")
    chosen = parser.parse_args(words)
    rows = [row for row in ROWS if chosen.only in row]
    if not rows:
        parser.error(f"--only {chosen.only}: in none of: {'; '.join(ROWS)}")
    options = {"vpls": chosen.vpls, "size": chosen.size, "turns": chosen.turns, "device": chosen.device}
    columns = [column(name, rows, **options) for name in chosen.scenes]
    head, *body = zip(["", *rows], *columns, strict=True)
    conditions = (
        f"{name_device(chosen.device)}; {os.cpu_count()} cores, Python {platform.python_version()}. "
        f"{chosen.turns} turns with {chosen.vpls} VPLs at {chosen.size[0]}x{chosen.size[1]}; median (quartiles)."
    )
    return f"{markdown(head, body)}\n\n{conditions}"


def main() -> None:
    """Print the table."""
    try:
        print(report())
    except Error as error:
        raise SystemExit(str(error)) from None


if __name__ == "__main__":
    main()
