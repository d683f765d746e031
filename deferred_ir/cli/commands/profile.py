"""`deferred-ir profile`: error against run time of a sweep, or of the merged shards of one."""

from __future__ import annotations

import argparse
import re
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from deferred_ir.base.errors import OutputError, SettingError
from deferred_ir.cli.options import (
    SCENE,
    add_device,
    add_size,
    parse_count,
    parse_counts,
    parse_duration,
    parse_seconds,
    print_notes,
    split_list,
)

if TYPE_CHECKING:
    from deferred_ir.profiling.sweep.run import Results
    from deferred_ir.scene.scene import RenderDefaults

HELP = "Measure error against run time: graphs x numbers of VPLs x seeds."
ORDER = 40
LAST = 1.0
"""Seconds: the time of the last frame, and of the reference, where something moves."""
BUDGET = 0.05
"""Seconds a frame for which settings are recommended."""


@dataclass(frozen=True)
class Effort:
    """What is measured unless options say otherwise.

    graphs: None: all that are built in. pixels: images have no more of them, None: as many as in a render. spp: most
    paths a pixel of the reference. peers: whether those that are installed are measured.
    """

    graphs: str | None
    vpls: str
    seeds: int
    pixels: int | None
    spp: int
    peers: bool


QUICK = Effort("deferred,interleaved,accurate,resampled", "16,64", 1, 128 * 128, 1024, False)
"""Under a minute on two cores without a GPU, for the built-in scenes."""
THOROUGH = Effort(None, "16,64,256", 3, None, 4096, True)


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of `deferred-ir profile`; most are None unless given, since --merge takes none of them."""
    parser.add_argument("scene", nargs="?", metavar="SCENE", help=SCENE)
    parser.add_argument("--merge", nargs="+", metavar="DIR", help="instead: join the points of these folders")
    parser.add_argument("-o", "--output", required=True, metavar="DIR", help="folder for points, tables and report")
    parser.add_argument("--graphs", metavar="A,B", help=f"names or files (default: {QUICK.graphs})")
    vpls = f"numbers of virtual point lights (default: {QUICK.vpls})"
    parser.add_argument("--vpls", metavar="N,N", help=vpls)
    parser.add_argument("--seeds", type=parse_count, metavar="K", help=f"seeds 0 to K-1 (default: {QUICK.seeds})")
    add_size(parser, default="128x128")
    more = f"--vpls {THOROUGH.vpls} --seeds {THOROUGH.seeds} --size 512x512"
    thorough = f"other defaults: all built-in graphs, {more}, peers, a better reference"
    parser.add_argument("--thorough", action="store_true", default=None, help=thorough)
    budget = "recommend settings for frames of T, such as 200ms or 0.2s (default: 50ms)"
    parser.add_argument("--budget", type=parse_duration, default=BUDGET, metavar="T", help=budget)
    parser.add_argument("--reference", metavar="R.npy", help="with R.json beside it (default: one is traced)")
    time = "where something moves: the frames end at T seconds, where the reference is (default: 1)"
    parser.add_argument("--time", type=parse_seconds, metavar="T", help=time)
    parser.add_argument("--shard", metavar="I/N", help="measure the I-th of N parts only")
    peers = "other renderers to compare: mitsuba, cycles (default: none; with --thorough all that are installed)"
    parser.add_argument("--peers", metavar="A,B|none", help=peers)
    add_device(parser)


def run(arguments: argparse.Namespace) -> int:
    """Measure a sweep or merge its shards, and write the report."""
    from deferred_ir.profiling.report import report

    report.check_libraries()
    folder = Path(arguments.output)
    results = _merge(arguments, folder) if arguments.merge else _measure(arguments, folder)
    print(report.write_all(folder, results, 1e3 * arguments.budget))
    print(folder / "report.html", file=sys.stderr)
    return 0


def _measure(arguments: argparse.Namespace, folder: Path) -> Results:
    """Run the sweep."""
    if arguments.scene is None:
        raise SettingError("profile: wants a SCENE to measure, or --merge DIR...")
    from deferred_ir.engine.settings import list_notes
    from deferred_ir.graph.file import find_obstacles, graph_names
    from deferred_ir.loading.load import load
    from deferred_ir.profiling.peers import ladder
    from deferred_ir.profiling.sweep.run import run as run_sweep
    from deferred_ir.profiling.sweep.sweep import Sweep
    from deferred_ir.report.origin import describe_run

    effort = THOROUGH if arguments.thorough else QUICK
    counts = _parse_vpls(effort.vpls if arguments.vpls is None else arguments.vpls)
    shard = _parse_shard(arguments.shard)
    peers = ladder.choose(arguments.peers) if arguments.peers is not None or effort.peers else ()
    names = effort.graphs if arguments.graphs is None else arguments.graphs
    obstacles = find_obstacles() if names is None else {}
    graphs = [name for name in graph_names() if name not in obstacles] if names is None else split_list(names)
    scene = load(arguments.scene)
    size = _choose_size(arguments.size, scene.render, effort)
    seeds = effort.seeds if arguments.seeds is None else arguments.seeds
    time = LAST if arguments.time is None else arguments.time
    time = time if scene.moves else 0.0
    what = Sweep(scene, size, graphs, counts, seeds, arguments.device, shard, peers, time, effort.spp)
    print_notes([*list_notes(scene), *(f"left out: {obstacle}" for obstacle in obstacles.values())])
    given = Path(arguments.reference) if arguments.reference else None
    return run_sweep(what, folder, given, describe_run(arguments.command_line))


def _merge(arguments: argparse.Namespace, folder: Path) -> Results:
    """Join the points of the shards that --merge names."""
    without = ("graphs", "vpls", "seeds", "size", "reference", "shard", "peers", "time", "thorough", "scene")
    extra = [name for name in without if getattr(arguments, name) is not None]
    if extra:
        what = "a SCENE" if extra[0] == "scene" else f"--{extra[0]}"
        raise SettingError(f"--merge: takes folders only, not {what}; leave it out")
    for name in arguments.merge:
        if not Path(name).is_dir():
            raise OutputError(f"{name}: is no folder; --merge joins folders that profile wrote")
    from deferred_ir.profiling.sweep import shards

    results, broken = shards.merge([Path(name) for name in arguments.merge], folder)
    if broken:
        print_notes([f"{broken} points were unusable and left out; run their shard again"])
    return results


def _choose_size(text: str | None, defaults: RenderDefaults, effort: Effort) -> tuple[int, int]:
    """Return (width, height): --size, else a render's, reduced in proportion to the pixels of `effort`."""
    from deferred_ir.engine.settings import choose_size

    width, height = choose_size(text, defaults)
    if text is not None or effort.pixels is None or width * height <= effort.pixels:
        return width, height
    scale = (effort.pixels / (width * height)) ** 0.5
    return max(round(width * scale), 1), max(round(height * scale), 1)


def _parse_vpls(text: str) -> list[int]:
    """Read --vpls; none at all is a fault that the sweep reports."""
    return parse_counts("--vpls", text, THOROUGH.vpls) if text.strip(", ") else []


def _parse_shard(text: str | None) -> tuple[int, int]:
    """Read (i, n) from `--shard i/n`; without it the sweep is one part."""
    if text is None:
        return 1, 1
    match = re.fullmatch(r"([0-9]{1,6})/([0-9]{1,6})", text)
    if not match or not 1 <= int(match[1]) <= int(match[2]):
        raise SettingError(f"--shard {text}: wants i/n with i from 1 to n, such as 1/4")
    return int(match[1]), int(match[2])
