"""Watches the files that a picture depends on, graphs and shaders, for changes."""

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


def list_files(graph: str, plan: Plan) -> set[Path]:
    """Return the graph's file, those that it extends, and all files in the folders of shaders."""
    folders = {package_shaders()} | {step.work.shader_folder for step in plan.steps if step.work.shader_folder}
    shaders = {path for folder in folders for path in folder.rglob("*.*") if path.suffix not in (".py", ".pyc")}
    return shaders | set(graph_files(graph))


def is_graph(path: str) -> bool:
    """Return whether a file is a graph: TOML with passes or outputs, and without the models of a scene."""
    try:
        table = tomllib.loads(Path(path).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return False
    return "model" not in table and bool({"passes", "outputs", "extends"} & table.keys())


class FileWatch:
    """Looks at the times and sizes of files every PERIOD."""

    def __init__(self) -> None:
        self._seen: dict[Path, tuple[int, int]] | None = None
        self._next = 0.0

    def look(self, graph: str, plan: Plan) -> bool:
        """Return whether a file has changed since the last look; False while the next one is not due."""
        now = time.monotonic()
        if now < self._next:
            return False
        self._next = now + PERIOD
        before, self._seen = self._seen, _read_stamps(list_files(graph, plan))
        return before is not None and any(before.get(path, stamp) != stamp for path, stamp in self._seen.items())


def _read_stamps(paths: Iterable[Path]) -> dict[Path, tuple[int, int]]:
    """Read the time of the last change, in nanoseconds, and the size of each file."""
    stamps = {}
    for path in paths:
        try:
            stat = path.stat()
        except OSError:  # an editor is just replacing it
            continue
        stamps[path] = stat.st_mtime_ns, stat.st_size
    return stamps
