"""A virtual display with real key and mouse events, and helpers of the tests of the viewer."""

from __future__ import annotations

import os
import subprocess
import time
from collections.abc import Container, Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any

from deferred_ir.engine.renderer import Renderer
from deferred_ir.loading.load import load
from deferred_ir.scene.scene import Scene
from deferred_ir.viewer.app import Viewer
from deferred_ir.viewer.panels.side_panel import WIDTH

SCREEN = "1700x1000x24"
SIZE = (128, 96)
"""Of the picture."""
FEW = {"vpl.count": 8}
PATIENCE = 20.0
"""Seconds until a window that does not follow is at fault."""


@cache
def cornell() -> Scene:
    """Load the Cornell box, which most tests use, once."""
    return load("cornell")


@contextmanager
def display() -> Iterator[str]:
    """Run Xvfb and make it this process's display. Yields its name."""
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
    """Run one command of xdotool."""
    subprocess.run(["xdotool", *map(str, words)], check=True)


def act(viewer: Viewer, *words: object, frames: int = 4) -> None:
    """Let xdotool make events, and the viewer take them: Dear ImGui spreads a press and its release over frames.

    When xdotool has ended they wait to be taken.
    """
    xdo(*words)
    for _ in range(frames):
        viewer.frame()
        with viewer.window:
            viewer.window.show()


def picture(viewer: Viewer) -> Any:
    """Read the part of the window that the picture fills, uint8 (H, W, 3)."""
    area = viewer.area()
    return viewer.screenshot()[:, : area.width]


_shared: list[Renderer] = []


def rendered(scene: Scene, size: tuple[int, int] = SIZE, graph: str = "deferred", **options: Any) -> Any:
    """Render display pixels without a window; set: {"pass.param": value}, time: seconds, accumulate: frames."""
    if not _shared:
        _shared.append(Renderer(size, graph, device="software"))
    _shared[0].configure(size=size, graph=graph, set=options.pop("set", {}))
    _shared[0].reset()
    return _shared[0].render(scene, **options).display


def close_renderer() -> None:
    """End the renderer of `rendered`."""
    while _shared:
        _shared.pop().close()


def frames(viewer: Viewer, count: int = 4) -> None:
    """Draw some frames without input."""
    for _ in range(count):
        viewer.frame()


def restore(viewer: Viewer) -> None:
    """Bring the window back to the Cornell box, seen and lit as its file says, and undo all choices."""
    session, panel = viewer.session, viewer.panel
    session.use(cornell())
    if (session.graph, session.settings) != ("deferred", FEW) or session.error:
        session.change("deferred", FEW)
    session.seed, session.from_light, session.playing, session.progressive = 0, False, False, False
    panel.reference.job.stop()
    panel.reference.job.result, panel.passes.pinned, panel.maps.light, panel.saved = None, None, 0, ""
    viewer.controls.switches.update(frames=False, outlines=False, map=False, panel=True)
    viewer.window.resize((SIZE[0] + WIDTH, SIZE[1]))
    act(viewer, "mousemove", 20, 20, frames=2)
    until = time.monotonic() + PATIENCE  # a busy display takes its time
    while session.size != SIZE and time.monotonic() < until:
        time.sleep(0.02)
        viewer.frame()
    assert session.size == SIZE, f"the window is {viewer.window.size}"
    assert session.error == ""


class Spy:
    """Dear ImGui for one part of the panel, which notes its words, and where in the window they are; use with `with`.

    opened: the parts of the panel that are to be open, None to leave them.
    places: by the first word of each call, its rectangle (x0, y0, x1, y1). calls: (function, word) in order.
    """

    def __init__(self, owner: Any, opened: Container[str] | None = None) -> None:
        self._owner, self._imgui, self._opened = owner, owner._imgui, opened
        self.calls: list[tuple[str, str]] = []
        self.places: dict[str, tuple[float, float, float, float]] = {}

    def __enter__(self) -> Spy:
        self._owner._imgui = self
        return self

    def __exit__(self, *error: object) -> None:
        self._owner._imgui = self._imgui

    def __getattr__(self, name: str) -> Any:
        found = getattr(self._imgui, name)

        def call(*words: Any, **more: Any) -> Any:
            if self._opened is not None and name == "collapsing_header":
                self._imgui.set_next_item_open(words[0] in self._opened)
            result = found(*words, **more)
            if words and isinstance(words[0], str):
                self.calls.append((name, words[0]))
                low, high = self._imgui.get_item_rect_min(), self._imgui.get_item_rect_max()
                self.places[words[0]] = low.x, low.y, high.x, high.y
            return result

        return call if callable(found) and name.islower() else found


def arrange(viewer: Viewer, *opened: str) -> None:
    """Open these parts of the panel and no others; by default Scene, Lights and Passes."""
    with Spy(viewer.panel, opened or ("Scene", "Lights", "Passes")):
        frames(viewer, 2)


def middle(viewer: Viewer, owner: Any, label: str, inside: int = 100) -> tuple[int, int]:
    """Return a point of the widget of `owner` with this label: `inside` pixels from its left, at half its height."""
    with Spy(owner) as spy:
        viewer.frame()
    x0, y0, _, y1 = next(place for name, place in spy.places.items() if name.startswith(label))
    return round(x0 + inside), round((y0 + y1) / 2)
