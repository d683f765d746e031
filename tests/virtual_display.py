"""A virtual display with real key and mouse events, for tests of the viewer."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager

from deferred_ir.viewer.app import Viewer

SCREEN = "1400x1000x24"


@contextmanager
def display() -> Iterator[str]:
    """Runs Xvfb and makes it this process's display; its name."""
    read, write = os.pipe()
    server = subprocess.Popen(
        ["Xvfb", "-displayfd", str(write), "-screen", "0", SCREEN, "-nolisten", "tcp"],
        pass_fds=[write],
        stderr=subprocess.DEVNULL,
    )
    os.close(write)
    with os.fdopen(read) as pipe:
        name = f":{pipe.readline().strip()}"
    before = os.environ.get("DISPLAY")
    os.environ["DISPLAY"] = name
    try:
        yield name
    finally:
        del os.environ["DISPLAY"]
        if before is not None:
            os.environ["DISPLAY"] = before
        server.terminate()
        server.wait()


def xdo(*words: object) -> None:
    """One command of xdotool."""
    subprocess.run(["xdotool", *map(str, words)], check=True, timeout=20)


def act(viewer: Viewer, *words: object, frames: int = 4) -> None:
    """Let xdotool make an event, and the viewer take it: Dear ImGui spreads a press and its release over frames."""
    xdo(*words)
    for _ in range(frames):
        viewer.frame(0.02)
        with viewer.window:
            viewer.window.show()
