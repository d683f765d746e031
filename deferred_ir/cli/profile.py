"""`deferred-ir profile`: error against run time of a sweep, or of the merged shards of one."""

from __future__ import annotations

import argparse
import re
import sys
from pathlib import Path
from typing import Any

from deferred_ir.base.errors import OutputError, SettingError
from deferred_ir.engine.settings import chosen_size, notes
from deferred_ir.graph.file import graph_names
from deferred_ir.loading.load import load

VPLS = "16,64,256"
SEEDS = 3
LAST = 1.0
"""Seconds: the time of the last frame, and of the reference, where something moves."""


def run(arguments: argparse.Namespace) -> int:
    """Measure or merge as the command line asks; an exit status."""
    from deferred_ir.profiling.report import report

    report.check_libraries()
    folder = Path(arguments.output)
    found, peers = _merged(arguments, folder) if arguments.merge else _measured(arguments, folder)
    print(report.write_all(folder, found, peers))
    print(folder / "report.html", file=sys.stderr)
    return 0


def _measured(arguments: argparse.Namespace, folder: Path) -> tuple[list[Any], Any]:
    """Points of the sweep, and what there is of peers."""
    if arguments.scene is None:
        raise SettingError("profile: wants a SCENE to measure, or --merge DIR...")
    from deferred_ir.profiling.peers import ladder
    from deferred_ir.profiling.sweep import sweep

    counts = _counts(VPLS if arguments.vpls is None else arguments.vpls)
    shard = _shard(arguments.shard)
    peers = ladder.chosen(arguments.peers)
    graphs = graph_names() if arguments.graphs is None else _names(arguments.graphs)
    scene = load(arguments.scene)
    size = chosen_size(arguments.size, scene.render)
    seeds = SEEDS if arguments.seeds is None else arguments.seeds
    time = LAST if arguments.time is None else arguments.time
    what = sweep.Sweep(scene, size, graphs, counts, seeds, arguments.device, shard, peers, time if scene.moves else 0.0)
    for note in notes(scene):
        print(f"note: {note}", file=sys.stderr)
    found: tuple[list[Any], Any] = sweep.run(what, folder, Path(arguments.reference) if arguments.reference else None)
    return found


def _merged(arguments: argparse.Namespace, folder: Path) -> tuple[list[Any], Any]:
    given = ("graphs", "vpls", "seeds", "size", "reference", "shard", "peers", "time", "scene")
    extra = [name for name in given if getattr(arguments, name) is not None]
    if extra:
        what = "a SCENE" if extra[0] == "scene" else f"--{extra[0]}"
        raise SettingError(f"--merge: takes folders only, not {what}; leave it out")
    for name in arguments.merge:
        if not Path(name).is_dir():
            raise OutputError(f"{name}: is no folder; --merge joins folders that profile wrote")
    from deferred_ir.profiling.sweep import shards

    found, peers, broken = shards.merge([Path(name) for name in arguments.merge], folder)
    if broken:
        print(f"note: {broken} points were unusable and left out; run their shard again", file=sys.stderr)
    return found, peers


def _names(text: str) -> list[str]:
    return list(dict.fromkeys(name for part in text.split(",") if (name := part.strip())))


def _counts(text: str) -> list[int]:
    """The numbers of `--vpls 16,64`, each once."""
    names = _names(text)
    for name in names:
        if not re.fullmatch(r"[0-9]{1,9}", name):
            raise SettingError(f"--vpls {text}: '{name}' is no whole number from 0 up; write 16,64,256")
    return list(dict.fromkeys(int(name) for name in names))


def _shard(text: str | None) -> tuple[int, int]:
    """(i, n) of `--shard i/n`."""
    if text is None:
        return 1, 1
    match = re.fullmatch(r"([0-9]{1,6})/([0-9]{1,6})", text)
    if not match or not 1 <= int(match[1]) <= int(match[2]):
        raise SettingError(f"--shard {text}: wants i/n with i from 1 to n, such as 1/4")
    return int(match[1]), int(match[2])
