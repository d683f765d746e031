"""Starts Dear ImGui and ImPlot on a window, and draws with them each frame."""

from __future__ import annotations

from deferred_ir.gl.window import Window


class Gui:
    """Dear ImGui's native backends on `window`, whose context must be current. Close it before the window."""

    def __init__(self, window: Window) -> None:
        from imgui_bundle import imgui, implot

        self._imgui, self._implot, self._window = imgui, implot, window
        self._context = imgui.create_context()
        self._plots = implot.create_context()
        imgui.get_io().set_ini_filename("")  # no file of ours in the user's folder
        imgui.get_style().scale_all_sizes(window.scale)
        imgui.get_style().font_scale_main = window.scale
        imgui.backends.glfw_init_for_opengl(window.handle, True)
        imgui.backends.opengl3_init("#version 430")

    def begin(self) -> None:
        """Begin a frame, with the events that the window has taken."""
        self._imgui.backends.opengl3_new_frame()
        self._imgui.backends.glfw_new_frame()
        self._imgui.new_frame()

    def end(self) -> None:
        """Draw what the frame asked for over what is in the window."""
        self._window.viewport(0, 0, *self._window.size)
        self._imgui.render()
        self._imgui.backends.opengl3_render_draw_data(self._imgui.get_draw_data())

    def close(self) -> None:
        """End both libraries."""
        self._imgui.backends.opengl3_shutdown()
        self._imgui.backends.glfw_shutdown()
        self._implot.destroy_context(self._plots)
        self._imgui.destroy_context(self._context)
