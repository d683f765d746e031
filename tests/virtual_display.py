"""A virtual display with real key and mouse events, and what tests of the viewer ask it for."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from deferred_ir.renderer import Renderer
from deferred_ir.scene import Scene
from deferred_ir.viewer.app import Viewer

SCREEN = "1700x1000x24"
SIZE = (128, 96)
"""Of the picture."""
FEW = {"vpl.count": 8}


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
    subprocess.run(["xdotool", *map(str, words)], check=True)


def act(viewer: Viewer, *words: object, frames: int = 4) -> None:
    """Let xdotool make an event, and the viewer take it: Dear ImGui spreads a press and its release over frames."""
    xdo(*words)
    for _ in range(frames):
        viewer.frame(0.02)
        with viewer.window:
            viewer.window.show()


def picture(viewer: Viewer) -> Any:
    """The part of the window in which the picture is."""
    area = viewer.area()
    return viewer.screenshot()[:, : area.width]


def rendered(scene: Scene, **options: Any) -> Any:
    """Display pixels without a window."""
    with Renderer(SIZE, device="software", **options) as renderer:
        return renderer.render(scene).display


def frames(viewer: Viewer, count: int = 4) -> None:
    """Some frames without input."""
    for _ in range(count):
        viewer.frame(0.02)
