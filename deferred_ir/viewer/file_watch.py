"""Which files a picture hangs on, graphs and shaders, and whether one of them has changed."""

from __future__ import annotations

import time
import tomllib
from collections.abc import Iterable
from pathlib import Path

from deferred_ir.gl.shaders import package_shaders
from deferred_ir.graph.file import graph_files
from deferred_ir.graph.graph import Plan

PERIOD = 0.3
"""Seconds between two looks."""


def files(graph: str, plan: Plan) -> set[Path]:
    """The graph's file and those that it extends, and all files in the folders of shaders."""
    folders = {package_shaders()} | {step.work.shader_folder for step in plan.steps if step.work.shader_folder}
    shaders = {path for folder in folders for path in folder.rglob("*.*") if path.suffix not in (".py", ".pyc")}
    return shaders | set(graph_files(graph))


def is_graph(path: str) -> bool:
    """Whether a file is a graph: TOML with passes or outputs, where a scene has models."""
    try:
        table = tomllib.loads(Path(path).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return False
    return "model" not in table and bool({"passes", "outputs", "extends"} & table.keys())


class Watch:
    """Looks at the times of files now and then."""

    def __init__(self) -> None:
        self._seen: dict[Path, tuple[int, int]] | None = None
        self._next = 0.0

    def changed(self, graph: str, plan: Plan) -> bool:
        """Whether a file has changed since the last look; no look before its time."""
        now = time.monotonic()
        if now < self._next:
            return False
        self._next = now + PERIOD
        found = _stamps(files(graph, plan))
        before, self._seen = self._seen, found
        return before is not None and any(before.get(path, stamp) != stamp for path, stamp in found.items())


def _stamps(paths: Iterable[Path]) -> dict[Path, tuple[int, int]]:
    stamps = {}
    for path in paths:
        try:
            stat = path.stat()
        except OSError:  # an editor is just replacing it
            continue
        stamps[path] = stat.st_mtime_ns, stat.st_size
    return stamps
