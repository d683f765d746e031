"""A window with an OpenGL context of its own: GLFW for the window, Dear ImGui's native backends for its controls.

imgui_bundle brings its own GLFW and must be imported before `glfw`, so that both use the same one.
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

    It is what moderngl calls a context: `load` finds functions, `with` makes it current. Raises DeviceError where
    there is no display, no OpenGL 4.3 on it, or no imgui_bundle.
    """

    def __init__(self, title: str, size: tuple[int, int]) -> None:
        self._imgui, self._implot, self._glfw = _modules()
        glfw = self._glfw
        failures: list[str] = []
        self._told = glfw.ERROR_REPORTING, failures
        glfw.ERROR_REPORTING = "ignore"
        glfw.set_error_callback(lambda code, text: failures.append(text.decode(errors="replace")))
        if not glfw.init():
            raise DeviceError(f"view: no display ({_last(failures)}); {ELSE}")
        glfw.window_hint(glfw.CONTEXT_VERSION_MAJOR, FLOOR // 100)
        glfw.window_hint(glfw.CONTEXT_VERSION_MINOR, FLOOR // 10 % 10)
        glfw.window_hint(glfw.OPENGL_PROFILE, glfw.OPENGL_CORE_PROFILE)
        glfw.window_hint(glfw.DEPTH_BITS, 0)
        self._window = glfw.create_window(*size, title, None, None)
        if not self._window:
            glfw.terminate()
            raise DeviceError(f"view: no window with OpenGL 4.3 ({_last(failures)}); {ELSE}")
        self._before: list[Any] = []
        self._look()
        glfw.make_context_current(self._window)
        glfw.swap_interval(0)  # a slow frame must not wait for the next refresh of the screen
        self.gl = raw.GL(self)
        self.on_drop: Callable[[list[str]], None] = lambda paths: None
        glfw.set_drop_callback(self._window, lambda window, paths: self.on_drop(list(paths)))
        self._start_controls()

    def _start_controls(self) -> None:
        imgui = self._imgui
        self._context = imgui.create_context()
        self._plots = self._implot.create_context()
        imgui.get_io().set_ini_filename("")  # no file of ours in the user's folder
        scale = self.scale
        imgui.get_style().scale_all_sizes(scale)
        imgui.get_style().font_scale_main = scale
        imgui.backends.glfw_init_for_opengl(ctypes.cast(self._window, ctypes.c_void_p).value, True)
        imgui.backends.opengl3_init("#version 430")

    @property
    def scale(self) -> float:
        """How much larger the screen wants text than at 96 dots an inch."""
        return float(max(self._glfw.get_window_content_scale(self._window)))

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in pixels as the frame began; 0 while it is minimised on some systems."""
        return self._size

    @property
    def minimised(self) -> bool:
        """Whether nothing of it could be seen as the frame began."""
        return self._iconified or 0 in self._size

    def _look(self) -> None:
        """Ask for size and state, once a frame: that waits for an answer of the display."""
        width, height = self._glfw.get_framebuffer_size(self._window)
        self._size = int(width), int(height)
        self._iconified = bool(self._glfw.get_window_attrib(self._window, self._glfw.ICONIFIED))

    @property
    def closing(self) -> bool:
        """Whether the user has closed it."""
        return bool(self._glfw.window_should_close(self._window))

    def begin(self, wait: float = 0.0) -> None:
        """Take the events that came, waiting up to `wait` seconds for one, and start a frame of controls."""
        if wait > 0:
            self._glfw.wait_events_timeout(wait)
        else:
            self._glfw.poll_events()
        self._look()
        self._imgui.backends.opengl3_new_frame()
        self._imgui.backends.glfw_new_frame()
        self._imgui.new_frame()

    def target(self) -> None:
        """Draw into the window from now on, all of it dark."""
        self.gl.BindFramebuffer(raw.FRAMEBUFFER, 0)
        self.gl.Viewport(0, 0, *self.size)
        self.gl.ClearBufferfv(raw.COLOR, 0, (ctypes.c_float * 4)(0.06, 0.06, 0.07, 1.0))

    def viewport(self, x: int, y: int, width: int, height: int) -> None:
        """Draw into this part of the window, from its lower left corner."""
        self.gl.BindFramebuffer(raw.FRAMEBUFFER, 0)
        self.gl.Viewport(x, y, width, height)

    def end(self) -> None:
        """Draw the controls over what is there."""
        self.viewport(0, 0, *self.size)
        self._imgui.render()
        self._imgui.backends.opengl3_render_draw_data(self._imgui.get_draw_data())

    def show(self) -> None:
        """Put on screen what was drawn."""
        self._glfw.swap_buffers(self._window)

    def pixels(self) -> np.ndarray:
        """What was drawn and not yet shown, uint8 (H, W, 3), top row first."""
        width, height = self.size
        pixels = np.empty((height, width, 3), np.uint8)
        self.gl.BindFramebuffer(raw.FRAMEBUFFER, 0)
        self.gl.PixelStorei(raw.PACK_ALIGNMENT, 1)
        self.gl.ReadPixels(0, 0, width, height, raw.RGB, raw.UNSIGNED_BYTE, pixels.ctypes.data_as(ctypes.c_void_p))
        return np.ascontiguousarray(pixels[::-1])

    def resize(self, size: tuple[int, int]) -> None:
        """Ask for another size."""
        self._glfw.set_window_size(self._window, *size)

    def title(self, text: str) -> None:
        """Put `text` into the title bar."""
        self._glfw.set_window_title(self._window, text)

    def load(self, name: str) -> int:
        """Address of an OpenGL function, 0 if there is none."""
        return self._glfw.get_proc_address(name) or 0

    def __enter__(self) -> Window:
        self._before.append(self._glfw.get_current_context())
        self._glfw.make_context_current(self._window)
        return self

    def __exit__(self, *error: object) -> None:
        self._glfw.make_context_current(self._before.pop())

    def release(self) -> None:
        """Nothing: whoever draws in it does not own the window; `close` ends it."""

    def close(self) -> None:
        """Destroy the window and its context."""
        self._glfw.make_context_current(self._window)
        self._imgui.backends.opengl3_shutdown()
        self._imgui.backends.glfw_shutdown()
        self._implot.destroy_context(self._plots)
        self._imgui.destroy_context(self._context)
        self._glfw.destroy_window(self._window)
        self._glfw.terminate()
        self._glfw.ERROR_REPORTING = self._told[0]


def _modules() -> tuple[Any, Any, Any]:
    """imgui, implot and glfw, in this order."""
    try:
        from imgui_bundle import imgui, implot
    except ImportError as error:
        if "imgui_bundle" in str(getattr(error, "name", None)):
            raise DeviceError(f"view: imgui-bundle is not installed; {INSTALL}, or {ELSE}") from error
        raise DeviceError(f"view: imgui-bundle cannot be loaded ({error}); {ELSE}") from error
    import glfw

    return imgui, implot, glfw


def _last(failures: list[str]) -> str:
    """GLFW's last complaint, or what is known without one."""
    if failures:
        return " ".join(failures[-1].split())
    unset = sys.platform == "linux" and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
    return "DISPLAY is not set" if unset else "GLFW does not say why"


def display_opens() -> bool:
    """Whether a window could open here. Raises ImportError without GLFW."""
    import glfw

    glfw.ERROR_REPORTING = "ignore"
    if not glfw.init():
        return False
    glfw.terminate()
    return True
