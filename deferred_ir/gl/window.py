"""A window with an OpenGL context of its own, by GLFW.

imgui_bundle, which draws in it, brings its own GLFW and must be imported before `glfw`, so that both use the same one.
"""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Callable
from typing import Any

import numpy as np

from deferred_ir.base.errors import DeviceError
from deferred_ir.gl import raw
from deferred_ir.gl.devices import FLOOR

INSTALL = "pip install 'deferred-ir[viewer]'"
ELSE = "`deferred-ir render SCENE` makes pictures without a window"


class Window:
    """A visible window of (width, height) pixels; its context is current in this thread. Close it when done.

    It is what moderngl calls a context: `load` finds functions, `with` makes it current. Raises DeviceError without a
    display, OpenGL 4.3 on it, or imgui_bundle.
    """

    def __init__(self, title: str, size: tuple[int, int]) -> None:
        self._glfw = _import_glfw()
        glfw = self._glfw
        failures: list[str] = []
        self._reporting = glfw.ERROR_REPORTING
        glfw.ERROR_REPORTING = "ignore"
        glfw.set_error_callback(lambda code, text: failures.append(text.decode(errors="replace")))
        if not glfw.init():
            raise DeviceError(f"view: no display ({_describe_last(failures)}); {ELSE}")
        glfw.window_hint(glfw.CONTEXT_VERSION_MAJOR, FLOOR // 100)
        glfw.window_hint(glfw.CONTEXT_VERSION_MINOR, FLOOR // 10 % 10)
        glfw.window_hint(glfw.OPENGL_PROFILE, glfw.OPENGL_CORE_PROFILE)
        glfw.window_hint(glfw.DEPTH_BITS, 0)
        self._window = glfw.create_window(*size, title, None, None)
        if not self._window:
            glfw.terminate()
            raise DeviceError(f"view: no window with OpenGL 4.3 ({_describe_last(failures)}); {ELSE}")
        self._before: list[Any] = []
        self._read_state()
        glfw.make_context_current(self._window)
        glfw.swap_interval(0)  # a slow frame must not wait for the next refresh of the screen
        self.gl = raw.GL(self)
        self.on_drop: Callable[[list[str]], None] = lambda paths: None
        glfw.set_drop_callback(self._window, lambda window, paths: self.on_drop(list(paths)))

    @property
    def handle(self) -> int:
        """Address of GLFW's own window."""
        return ctypes.cast(self._window, ctypes.c_void_p).value or 0

    @property
    def scale(self) -> float:
        """Size of text that the screen asks for, 1 at 96 dots an inch."""
        return float(max(self._glfw.get_window_content_scale(self._window)))

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in pixels when events were last taken; 0 on some systems while it is minimised."""
        return self._size

    @property
    def minimised(self) -> bool:
        """Whether the window was minimised or empty when events were last taken."""
        return self._iconified or 0 in self._size

    def _read_state(self) -> None:
        """Ask for size and state, once a frame only: that waits for an answer of the display."""
        width, height = self._glfw.get_framebuffer_size(self._window)
        self._size = int(width), int(height)
        self._iconified = bool(self._glfw.get_window_attrib(self._window, self._glfw.ICONIFIED))

    @property
    def closing(self) -> bool:
        """Whether the user has closed the window."""
        return bool(self._glfw.window_should_close(self._window))

    def take_events(self, wait: float = 0.0) -> None:
        """Take the events that came, waiting up to `wait` seconds for one."""
        if wait > 0:
            self._glfw.wait_events_timeout(wait)
        else:
            self._glfw.poll_events()
        self._read_state()

    def clear(self) -> None:
        """Make the window the target of drawing, and all of it dark."""
        self.gl.BindFramebuffer(raw.FRAMEBUFFER, 0)
        self.gl.Viewport(0, 0, *self.size)
        self.gl.ClearBufferfv(raw.COLOR, 0, (ctypes.c_float * 4)(0.06, 0.06, 0.07, 1.0))

    def viewport(self, x: int, y: int, width: int, height: int) -> None:
        """Draw into this part of the window, pixels from its lower left corner."""
        self.gl.BindFramebuffer(raw.FRAMEBUFFER, 0)
        self.gl.Viewport(x, y, width, height)

    def show(self) -> None:
        """Bring what was drawn onto the screen."""
        self._glfw.swap_buffers(self._window)

    def pixels(self) -> np.ndarray:
        """Read what was drawn and not yet shown, uint8 (H, W, 3), top row first."""
        width, height = self.size
        pixels = np.empty((height, width, 3), np.uint8)
        self.gl.BindFramebuffer(raw.FRAMEBUFFER, 0)
        self.gl.PixelStorei(raw.PACK_ALIGNMENT, 1)
        self.gl.ReadPixels(0, 0, width, height, raw.RGB, raw.UNSIGNED_BYTE, pixels.ctypes.data_as(ctypes.c_void_p))
        return np.ascontiguousarray(pixels[::-1])

    def resize(self, size: tuple[int, int]) -> None:
        """Ask for another (width, height) in pixels."""
        self._glfw.set_window_size(self._window, *size)

    def title(self, text: str) -> None:
        """Put `text` into the title bar."""
        self._glfw.set_window_title(self._window, text)

    def load(self, name: str) -> int:
        """Return the address of an OpenGL function, 0 if there is none."""
        return self._glfw.get_proc_address(name) or 0

    def __enter__(self) -> Window:
        self._before.append(self._glfw.get_current_context())
        self._glfw.make_context_current(self._window)
        return self

    def __exit__(self, *error: object) -> None:
        self._glfw.make_context_current(self._before.pop())

    def release(self) -> None:
        """Do nothing: whoever draws in the window does not own it; `close` ends it."""

    def close(self) -> None:
        """Destroy the window and its context."""
        self._glfw.make_context_current(self._window)
        self._glfw.destroy_window(self._window)
        self._glfw.terminate()
        self._glfw.ERROR_REPORTING = self._reporting


def _import_glfw() -> Any:
    """Import imgui_bundle and then glfw. Raises DeviceError."""
    try:
        import imgui_bundle
    except ImportError as error:
        if "imgui_bundle" in str(getattr(error, "name", None)):
            raise DeviceError(f"view: imgui-bundle is not installed; {INSTALL}, or {ELSE}") from error
        raise DeviceError(f"view: imgui-bundle cannot be loaded ({error}); {ELSE}") from error
    import glfw

    del imgui_bundle
    return glfw


def _describe_last(failures: list[str]) -> str:
    """Return GLFW's last complaint, or what is known without one."""
    if failures:
        return " ".join(failures[-1].split())
    unset = sys.platform == "linux" and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
    return "DISPLAY is not set" if unset else "GLFW does not say why"


def can_open_display() -> bool:
    """Return whether a window could open here. Raises ImportError without GLFW."""
    import glfw

    glfw.ERROR_REPORTING = "ignore"
    if not glfw.init():
        return False
    glfw.terminate()
    return True
