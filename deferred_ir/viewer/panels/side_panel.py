"""The panel at the right of the window: everything that can be changed, and what it costs."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from deferred_ir.base.errors import Error
from deferred_ir.engine.accumulation import Accumulation
from deferred_ir.frame.vpl_params import VPLS_ALIVE
from deferred_ir.gl.window import Window
from deferred_ir.graph.file import graph_names
from deferred_ir.graph.params import specs
from deferred_ir.loading.load import builtin_scenes
from deferred_ir.viewer.canvas import Area, Canvas
from deferred_ir.viewer.controls import KEYS, Controls
from deferred_ir.viewer.panels.light_axes import draw_axes
from deferred_ir.viewer.panels.light_outlines import draw_outlines
from deferred_ir.viewer.panels.lights import LightsPanel
from deferred_ir.viewer.panels.lines import Overlay
from deferred_ir.viewer.panels.materials import MaterialsPanel
from deferred_ir.viewer.panels.parameters import draw_widget
from deferred_ir.viewer.panels.passes import PassesPanel
from deferred_ir.viewer.panels.reference import ReferencePanel
from deferred_ir.viewer.panels.shadow_maps import ShadowMapsPanel
from deferred_ir.viewer.saving import save
from deferred_ir.viewer.session import Session

WIDTH = 380
"""Of the panel, pixels at 96 dots an inch."""
FOLDER = Path()
"""Where pictures are saved: the working folder."""


class Panel:
    """Draws all controls. `busy`: something runs that will change what is shown, without input."""

    def __init__(self, window: Window, session: Session, controls: Controls) -> None:
        from imgui_bundle import imgui, implot

        self._imgui, self._implot = imgui, implot
        self._window, self._session, self._controls = window, session, controls
        self.lights = LightsPanel(imgui, session, controls)
        self.materials = MaterialsPanel(imgui, session)
        self.passes = PassesPanel(imgui, session)
        self.maps = ShadowMapsPanel(imgui, session, controls)
        self.reference = ReferencePanel(imgui, session)
        self.saved = ""
        self._scenes = [name for name, _ in builtin_scenes()]

    @property
    def width(self) -> int:
        """Pixels of the window that the panel covers."""
        if not self._controls.switches["panel"]:
            return 0
        return min(round(WIDTH * self._window.scale), max(self._window.size[0] - 1, 0))

    @property
    def busy(self) -> bool:
        """Whether the next frame will differ by itself."""
        session = self._session
        return session.playing or session.progressive or session.recording or self.reference.job.running

    def draw(self, area: Area) -> None:
        """Draw all controls of this frame, and lights and VPLs as lines over the picture in `area`."""
        imgui, (width, height) = self._imgui, self._window.size
        overlay = Overlay(imgui, self._session, area, height, self.maps.edge(area))
        if self._controls.switches["frames"]:
            draw_axes(overlay)
        if self._controls.switches["outlines"]:
            draw_outlines(overlay)
        if self.width == 0 or height == 0:
            return
        imgui.set_next_window_pos(imgui.ImVec2(width - self.width, 0))
        imgui.set_next_window_size(imgui.ImVec2(self.width, height))
        fixed = imgui.WindowFlags_.no_move | imgui.WindowFlags_.no_resize | imgui.WindowFlags_.no_title_bar
        imgui.begin("deferred-ir", None, fixed | imgui.WindowFlags_.no_collapse)
        imgui.push_item_width(-round(150 * self._window.scale))
        self._status()
        for name, part, is_open in (
            ("Scene", self._scene, True),
            ("Lights", self.lights.draw, True),
            ("Materials", self.materials.draw, False),
            ("Passes", self.passes.draw, True),
            ("Parameters", self._parameters, False),
            ("Reference", self.reference.draw, False),
            ("Shadow map", self.maps.draw, False),
            ("Save", self._save, False),
            ("Keys", self._keys, False),
        ):
            if imgui.collapsing_header(name, imgui.TreeNodeFlags_.default_open if is_open else 0):
                imgui.push_id(name)
                part()
                imgui.pop_id()
        imgui.pop_item_width()
        imgui.end()

    def _status(self) -> None:
        imgui, session = self._imgui, self._session
        times = np.array(session.frame_ms, dtype=np.float64)
        last = f"{times[-1]:.1f} ms" if len(times) else "no frame yet"
        alive = session.counters.get(VPLS_ALIVE.name)
        lights = "" if alive is None else f", {alive} VPLs"
        imgui.text(f"{session.scene.name}, {session.size[0]}x{session.size[1]}{lights}, {last}")
        if session.accumulation:
            imgui.text(f"mean of {session.accumulation.frames} frames{_describe_noise(session.accumulation)}")
        if distance := self.reference.text:
            imgui.text(distance)
        if self.saved:
            imgui.text_wrapped(self.saved)
        if error := session.error or session.lights.error:
            imgui.push_style_color(imgui.Col_.text, imgui.ImVec4(1.0, 0.45, 0.4, 1.0))
            imgui.text_wrapped(error)
            imgui.pop_style_color()
        size = imgui.ImVec2(-1, 90 * self._window.scale)
        plot, flags = self._implot, self._implot.Flags_
        if plot.begin_plot("##times", size, flags.no_inputs | flags.no_legend | flags.no_mouse_text):
            fit = plot.AxisFlags_.auto_fit
            plot.setup_axes("", "ms", plot.AxisFlags_.no_tick_labels | fit, fit)
            if len(times):
                plot.plot_line("frame", times)
            plot.end_plot()

    def _scene(self) -> None:
        imgui, session = self._imgui, self._session
        if imgui.begin_combo("scene", session.scene.name):
            for name in self._scenes:
                if imgui.selectable(name, name == session.scene.name)[0]:
                    session.open(name)
            imgui.end_combo()
        imgui.set_item_tooltip("Files of scenes, models and graphs can be dropped on the window.")
        if imgui.begin_combo("graph", session.graph):
            for name in graph_names():
                if imgui.selectable(name, name == session.graph)[0]:
                    session.choose(name)
            imgui.end_combo()
        touched, seed = imgui.input_int("seed", session.seed)
        if touched and seed >= 0:
            session.seed = seed
            session.invalidate()
        _, session.progressive = imgui.checkbox("progressive (Space)", session.progressive)
        imgui.set_item_tooltip("Average frames with new samples while nothing moves.")
        touched, fov = imgui.slider_float("camera FOV", session.camera.fov, 5.0, 150.0, "%.1f degrees")
        if touched:
            session.look(replace(session.camera, fov=fov))
        if session.scene.moves:
            _, session.playing = imgui.checkbox("play motions (P)", session.playing)

    def _parameters(self) -> None:
        imgui, session = self._imgui, self._session
        running = {step.name for step in session.plan.steps}
        for node in session.renderer.graph().nodes.values():
            known = specs(node.work.Params)
            if not known:
                continue
            imgui.separator_text(node.name if node.name in running else f"{node.name} (left out)")
            imgui.push_id(node.name)
            for name, spec in known.items():
                new = draw_widget(imgui, name, spec, getattr(node.work.params, name))
                if new is not None:
                    session.adjust(f"{node.name}.{name}", new)
            imgui.pop_id()

    def _save(self) -> None:
        imgui, session = self._imgui, self._session
        if imgui.button("save PNG, EXR and scene file (Ctrl S)"):
            self._controls.save()
        imgui.set_item_tooltip("Writes to the folder that the viewer was started in.")
        touched, on = imgui.checkbox("record camera and lights", session.recording)
        imgui.set_item_tooltip("When switched off, paths become the scene's motions: they can be played and are saved.")
        if touched:
            session.switch_recording(on)

    def finish(self) -> None:
        """Save the frame if asked to, now that it is drawn."""
        if not self._controls.saving:
            return
        self._controls.saving = False
        try:
            self.saved = f"saved {save(self._session, FOLDER)}"
        except Error as error:
            self.saved = str(error)

    def _keys(self) -> None:
        for binding in KEYS:
            self._imgui.text_disabled(binding.label)
            self._imgui.same_line()
            self._imgui.text_wrapped(binding.text)

    def show(self, canvas: Canvas, area: Area) -> None:
        """Draw the textures that lie over the picture."""
        self.reference.show(canvas, area)
        self.passes.show(canvas, area)
        self.maps.show(canvas, area)

    def close(self) -> None:
        """End work in the background."""
        self.reference.close()


def _describe_noise(mean: Accumulation) -> str:
    """Return an estimate of the error of a mean of frames; "" before there is one."""
    told = mean.latest
    return f", relMSE by noise about {told.noise * told.frames / mean.frames:.2g}" if told else ""
