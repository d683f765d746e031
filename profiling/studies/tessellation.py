"""What keeping edges curved costs in paraboloid maps: split before all maps, or in each map what bends there.

    python -m deferred_ir.profiling.studies.tessellation cornell colors atrium -o out/tessellation

For each scene, `shadow_maps.edge` of pre-tessellated and `shadow_maps.bend` of adaptive maps step through their ranges:
triangles that are drawn, memory, time of the pass, and pairs of a pixel and a VPL of which map and ray disagree, as in
`deferred-ir check --visibility`. Writes tessellation.json and tessellation.svg; needs the extra `report`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from statistics import median
from typing import Any

from deferred_ir.base.files import write_json
from deferred_ir.base.progress import track
from deferred_ir.engine.record import Record
from deferred_ir.engine.renderer import Renderer
from deferred_ir.frame.frame import Frame
from deferred_ir.frame.pass_io import Io
from deferred_ir.loading.load import load
from deferred_ir.passes.shadow_maps import ShadowMaps
from deferred_ir.profiling.checks import visibility
from deferred_ir.profiling.measure import arguments, panels
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
"""A mismatch up to so many times another counts as no worse: well within the standard error of both."""
Row = dict[str, Any]


class CountedMaps(ShadowMaps):
    """Shadow maps that publish how many triangles reach the rasteriser."""

    def execute(self, frame: Frame, io: Io) -> None:
        """Draw, and count what comes of it."""
        with io.gpu.ctx.query(primitives=True) as query:
            super().execute(frame, io)
        io.count("triangles", query.primitives)


PASSES = {"counted_maps": CountedMaps}


def variants() -> list[Row]:
    """What is compared, each with its settings."""
    kinds = (("pre", "edge", EDGES), ("adaptive", "bend", BENDS))
    return [
        {
            "tessellation": kind,
            name: value,
            "settings": {"shadow_maps.tessellation": kind, f"shadow_maps.{name}": value},
        }
        for kind, name, values in kinds
        for value in values
    ]


def costs(scene: Scene, chosen: Sequence[Mapping[str, Any]], turns: int) -> list[Row]:
    """Triangles in all maps, extra bytes, and the pass's median time of `turns` frames, each drawn by turns."""
    with ExitStack() as stack:
        makes = [Renderer(SIZE, GRAPH, set={**SETTINGS, **each}, passes=PASSES) for each in chosen]
        renderers = [stack.enter_context(one) for one in makes]
        plans = [one.plan(scene, VPLS) for one in renderers]
        records = [Record() for _ in renderers]
        for one, plan in zip(renderers, plans, strict=True):
            one.draw(scene, plan)
        for turn in track(range(turns), scene.name):
            for one, plan, record in zip(renderers, plans, records, strict=True):
                one.draw(scene, plan, seed=turn, record=record)
        for one, record in zip(renderers, records, strict=True):
            one.finish(record)
        return [
            {
                "triangles": record.counters[0]["triangles"],
                "bytes": record.counters[-1].get("stand_in_bytes", 0),
                "ms": median(lap["shadow_maps"][0] for lap in record.laps),
            }
            for record in records
        ]


def mismatch(scene: Scene, settings: Mapping[str, Any], pairs: int) -> visibility.Share:
    """The share of pairs of a pixel and a VPL of which map and ray disagree."""
    options = visibility.Options(SIZE, pairs, (MAP_SIZE,), settings={**SETTINGS, **settings})
    return next(row.mismatch for row in visibility.rows(scene, options) if row.lights == "vpls")


def measure(scene: Scene, turns: int, pairs: int) -> list[Row]:
    """A row for each variant."""
    chosen = variants()
    found = costs(scene, [row["settings"] for row in chosen], turns)
    rows = []
    for row, cost in zip(chosen, found, strict=True):
        share = mismatch(scene, row.pop("settings"), pairs)
        rows.append({"scene": scene.name, **row, **cost, "mismatch": share.value, "error": share.error})
    return rows


def equal(rows: Sequence[Row]) -> list[tuple[Row, Row | None]]:
    """Each adaptive row of one scene, and the fastest pre-tessellated one that is no worse."""
    pre = [row for row in rows if row["tessellation"] == "pre"]
    return [
        (row, min((p for p in pre if p["mismatch"] <= EQUAL * row["mismatch"]), key=lambda p: p["ms"], default=None))
        for row in rows
        if row["tessellation"] == "adaptive"
    ]


def plot(rows: Sequence[Row], path: Path) -> None:
    """Mismatch over time, a panel for each scene; numbers are edges and bends."""
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
    """All rows, then what equals what, in Markdown."""
    lines = ["| scene | | triangles drawn | memory | ms | mismatch, % |", "|---|---|---|---|---|---|"]
    lines += [f"| {row['scene']} | {_name(row)} | {_cells(row)} |" for row in rows]
    lines += ["", "| scene | adaptive | triangles | ms | pre-tessellated | triangles | ms |", "|" + "---|" * 7]
    for scene in dict.fromkeys(row["scene"] for row in rows):
        for one, other in equal([row for row in rows if row["scene"] == scene]):
            beside = ("none", "", "") if other is None else (_name(other), _count(other), f"{other['ms']:.0f}")
            lines.append(f"| {scene} | {_name(one)} | {_count(one)} | {one['ms']:.0f} | {' | '.join(beside)} |")
    return "\n".join(lines)


def _name(row: Row) -> str:
    return f"pre, edge {row['edge']:g}" if "edge" in row else f"adaptive, bend {row['bend']:g}"


def _count(row: Row) -> str:
    return f"{row['triangles']:,}"


def _cells(row: Row) -> str:
    memory = f"{row['bytes'] / 2**10:,.0f} KiB" if row["bytes"] else "none"
    return f"{_count(row)} | {memory} | {row['ms']:.0f} | {100 * row['mismatch']:.3f} +-{100 * row['error']:.3f}"


def main() -> None:
    """Measure, write, print."""
    parser = arguments(__doc__)
    parser.add_argument("--turns", type=int, default=9, help="frames timed of each")
    parser.add_argument("--pairs", type=int, default=200_000)
    given = parser.parse_args()
    given.output.mkdir(parents=True, exist_ok=True)
    rows = [row for name in given.scenes for row in measure(load(name), given.turns, given.pairs)]
    write_json(given.output / "tessellation.json", {"vpls": VPLS, "map_size": MAP_SIZE, "rows": rows})
    plot(rows, given.output / "tessellation.svg")
    print(tables(rows))


if __name__ == "__main__":
    main()
