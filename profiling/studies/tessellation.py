"""Measure what curved edges cost in paraboloid maps: triangles split once for all maps, or in each map where they bend.

    python -m deferred_ir.profiling.studies.tessellation cornell colors atrium -o out/tessellation

For each scene, `shadow_maps.edge` of pre-tessellated maps and `shadow_maps.bend` of adaptive ones step through their
ranges. Measured are the triangles drawn, memory, the pass's time, and the pairs of a pixel and a VPL on which map and
ray disagree, as in `deferred-ir check --visibility`. Writes tessellation.json and tessellation.svg; needs the extra
`report`.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from statistics import median
from typing import Any

from deferred_ir.base.files import write_json
from deferred_ir.engine.renderer import Renderer
from deferred_ir.frame.frame import Frame
from deferred_ir.frame.pass_io import Io
from deferred_ir.loading.load import load
from deferred_ir.passes.shadow_maps import ShadowMaps
from deferred_ir.profiling.checks import visibility
from deferred_ir.profiling.figures import markdown, panels
from deferred_ir.profiling.measure import time_frames
from deferred_ir.profiling.study import command_line, run
from deferred_ir.scene.scene import Scene

GRAPH = Path(__file__).with_suffix(".toml")
SIZE = (256, 256)
VPLS = 64
MAP_SIZE = 256
SETTINGS = {
    "vpl.count": VPLS,
    "vpl.fov": 179.9,
    "shadow_maps.projection": "paraboloid",
    "shadow_maps.vpl_size": MAP_SIZE,
    "shadow_maps.spot_size": MAP_SIZE,
}
EDGES = (1.0, 0.2, 0.1, 0.05, 0.025)
BENDS = (16.0, 4.0, 1.0, 0.25)
EQUAL = 1.05
"""A mismatch up to this factor times another counts as no worse: well within the standard error of both."""
Row = dict[str, Any]
Name = tuple[str, str, float]
HEAD = "scene", "", "triangles drawn", "memory", "ms", "mismatch, %"
HEAD_OF_EQUALS = "scene", "adaptive", "triangles", "ms", "pre-tessellated", "triangles", "ms"


class CountedMaps(ShadowMaps):
    """Shadow maps that count the triangles that reach the rasteriser."""

    def execute(self, frame: Frame, io: Io) -> None:
        """Draw the maps and count their primitives."""
        with io.gpu.ctx.query(primitives=True) as query:
            super().execute(frame, io)
        io.count("triangles", query.primitives)


PASSES = {"counted_maps": CountedMaps}


def variants() -> dict[Name, dict[str, Any]]:
    """Return the settings of each variant by (tessellation, parameter, value)."""
    kinds = (("pre", "edge", EDGES), ("adaptive", "bend", BENDS))
    return {
        (kind, name, value): {"shadow_maps.tessellation": kind, f"shadow_maps.{name}": value}
        for kind, name, values in kinds
        for value in values
    }


def costs(scene: Scene, chosen: Mapping[Name, Mapping[str, Any]], turns: int) -> dict[Name, Row]:
    """Return the triangles in all maps, extra bytes and the pass's median time, by the names of the settings."""
    with ExitStack() as stack:
        renderers = {
            name: stack.enter_context(Renderer(SIZE, GRAPH, set={**SETTINGS, **settings}, passes=PASSES))
            for name, settings in chosen.items()
        }
        plans = {name: one.plan(scene, VPLS) for name, one in renderers.items()}
        times = time_frames(scene, renderers, plans, turns, label=scene.name, new_seeds=True)
        return {
            name: {
                "triangles": measured.counters[0]["triangles"],
                "bytes": measured.counters[-1].get("stand_in_bytes", 0),
                "ms": median(laps["shadow_maps"][0] for laps in measured.laps),
            }
            for name, measured in times.items()
        }


def mismatch(scene: Scene, settings: Mapping[str, Any], pairs: int) -> visibility.Fraction:
    """Return the fraction of the pairs of a pixel and a VPL on which map and ray disagree."""
    options = visibility.Options(SIZE, pairs, (MAP_SIZE,), settings={**SETTINGS, **settings})
    return next(row.mismatch for row in visibility.rows(scene, options) if row.lights == "vpls")


def measure(scene: Scene, turns: int, pairs: int) -> list[Row]:
    """Return a row for each variant."""
    chosen = variants()
    measured = costs(scene, chosen, turns)
    rows = []
    for (kind, name, value), settings in chosen.items():
        off = mismatch(scene, settings, pairs)
        cost = measured[kind, name, value]
        rows.append(
            {"scene": scene.name, "tessellation": kind, name: value, **cost, "mismatch": off.value, "error": off.error}
        )
    return rows


def equal(rows: Sequence[Row]) -> list[tuple[Row, Row | None]]:
    """Return each adaptive row of one scene with the fastest pre-tessellated one that is no worse, None without one."""
    pre = [row for row in rows if row["tessellation"] == "pre"]
    return [
        (row, min((p for p in pre if p["mismatch"] <= EQUAL * row["mismatch"]), key=lambda p: p["ms"], default=None))
        for row in rows
        if row["tessellation"] == "adaptive"
    ]


def plot(rows: Sequence[Row], path: Path) -> None:
    """Draw mismatch over time, a panel for each scene; the numbers are edges and bends."""
    scenes = list(dict.fromkeys(row["scene"] for row in rows))
    with panels(scenes, path, "pairs that disagree with rays [%]") as axes:
        for panel, scene in zip(axes, scenes, strict=True):
            for kind, name, marker in (("pre", "edge", "o-"), ("adaptive", "bend", "s-")):
                line = [row for row in rows if (row["scene"], row["tessellation"]) == (scene, kind)]
                panel.loglog([row["ms"] for row in line], [100 * row["mismatch"] for row in line], marker, label=kind)
                for row in line:
                    at = row["ms"], 100 * row["mismatch"]
                    panel.annotate(f"{row[name]:g}", at, (4, 4), textcoords="offset points", size=6)
            panel.set_xlabel("shadow_maps [ms]")


def tables(rows: Sequence[Row]) -> str:
    """Return all rows, then adaptive rows beside their pre-tessellated equals, as Markdown tables."""
    scenes = dict.fromkeys(row["scene"] for row in rows)
    equals = [
        [scene, _name(one), _count(one), f"{one['ms']:.0f}", *_cells_of_equal(other)]
        for scene in scenes
        for one, other in equal([row for row in rows if row["scene"] == scene])
    ]
    return f"{markdown(HEAD, [[row['scene'], *_cells(row)] for row in rows])}\n\n{markdown(HEAD_OF_EQUALS, equals)}"


def _name(row: Row) -> str:
    return f"pre, edge {row['edge']:g}" if "edge" in row else f"adaptive, bend {row['bend']:g}"


def _count(row: Row) -> str:
    return f"{row['triangles']:,}"


def _cells(row: Row) -> list[str]:
    memory = f"{row['bytes'] / 2**10:,.0f} KiB" if row["bytes"] else "none"
    off = f"{100 * row['mismatch']:.3f} +-{100 * row['error']:.3f}"
    return [_name(row), _count(row), memory, f"{row['ms']:.0f}", off]


def _cells_of_equal(row: Row | None) -> list[str]:
    return ["none", "", ""] if row is None else [_name(row), _count(row), f"{row['ms']:.0f}"]


def report(chosen: argparse.Namespace) -> None:
    """Measure each scene, write the files and print the tables."""
    rows = [row for name in chosen.scenes for row in measure(load(name), chosen.turns, chosen.pairs)]
    write_json(chosen.output / "tessellation.json", {"vpls": VPLS, "map_size": MAP_SIZE, "rows": rows})
    plot(rows, chosen.output / "tessellation.svg")
    print(tables(rows))


def main(words: Sequence[str] | None = None) -> None:
    """Run the study."""
    run(command_line(__doc__, output=True, turns=9, pairs=200_000), report, words)


if __name__ == "__main__":
    main()
