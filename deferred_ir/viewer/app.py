"""Runs the window: takes input, changes the session, draws the picture and the controls over it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from deferred_ir.gl.textures import GpuTexture
from deferred_ir.gl.window import Window
from deferred_ir.output.image import Image
from deferred_ir.viewer.canvas import Area, Canvas
from deferred_ir.viewer.controls import Controls
from deferred_ir.viewer.file_watch import FileWatch, is_graph
from deferred_ir.viewer.panels.gui import Gui
from deferred_ir.viewer.panels.side_panel import Panel
from deferred_ir.viewer.session import Session

IDLE = 0.1
"""Seconds that a frame waits for input where there is nothing to draw."""


class Viewer:
    """A window that shows a session. `frame` is one round of input, drawing and output."""

    def __init__(self, window: Window, session: Session) -> None:
        self.window, self.session = window, session
        with window:
            self._gui = Gui(window)
        self.canvas = Canvas(window, session.renderer.gpu, session.renderer.executor.library)
        self.controls = Controls(window, session)
        self.panel = Panel(window, session, self.controls)
        self.watch = FileWatch()
        self.frames = 0
        window.on_drop = self.drop

    def drop(self, paths: list[str]) -> None:
        """Open files that were dropped on the window: scenes, models and graph files."""
        for path in paths:
            if is_graph(path):
                self.session.choose(path)
            else:
                self.session.open(path)

    def area(self) -> Area:
        """Return the part of the window that the picture fills."""
        width, height = self.window.size
        return Area(0, 0, max(width - self.panel.width, 1), max(height, 1))

    def frame(self, wait: float = 0.0) -> bool:
        """Do one round. Returns whether the picture has changed. The frame is drawn but not yet on screen."""
        with self.window:
            self.window.take_events(wait)
            self._gui.begin()
            self.controls.take()
            self.panel.draw(self.area())
            self._reload()
            changed = False
            if not self.window.minimised:
                area = self.area()
                self.session.resize((area.width, area.height))
                changed = self.session.draw()
                self.window.clear()
                self._show_picture(area)
                self.panel.finish()
            self._gui.end()
            self.frames += 1
        return changed

    def _show_picture(self, area: Area) -> None:
        """Draw the picture, and what panels lay over it."""
        texture = self.session.output(self.session.plan.outputs["display"])
        if not isinstance(texture, GpuTexture):  # nothing was drawn so far
            return
        self.canvas.show(texture, area.fit(texture.size) if texture.size != (area.width, area.height) else area)
        self.panel.show(self.canvas, area)

    def _reload(self) -> None:
        """Read graph and shaders again if one of their files has changed."""
        if self.watch.look(self.session.graph, self.session.plan):
            self.session.change()
            if not self.session.error:
                self.session.reload_shaders()

    def screenshot(self) -> Any:
        """Read the window as it is, uint8 (H, W, 3), top row first."""
        with self.window:
            return self.window.pixels()

    def run(self, frames: int | None = None, screenshot: Path | None = None) -> None:
        """Run until the window is closed, or for `frames` frames; the last one is written to `screenshot`, too."""
        busy = True
        while not self.window.closing and (frames is None or self.frames < frames):
            changed = self.frame(0.0 if busy or frames is not None else IDLE)
            busy = (changed or self.panel.busy) and not self.window.minimised
            if screenshot and self.frames == frames:
                Image(None, self.screenshot()).save(screenshot)
            with self.window:
                self.window.show()

    def close(self) -> None:
        """End background work, release what is on the device and close the window."""
        with self.window:
            self.panel.close()
            self.session.close()
            self._gui.close()
        self.window.close()
