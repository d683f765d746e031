"""The list of passes: the profiler and the debug view in one. Hovering a row shows its output, a click pins it."""

from __future__ import annotations

from typing import Any

from deferred_ir.gl.buffers import GpuBuffer
from deferred_ir.gl.textures import GpuTexture
from deferred_ir.graph.graph import Step
from deferred_ir.viewer.canvas import Area, Canvas
from deferred_ir.viewer.session import Session

Source = tuple[str, str]


class PassesPanel:
    """Rows of passes: run, skipped and left out. `shown`: the (pass, port) to look at, None for the picture."""

    def __init__(self, imgui: Any, session: Session) -> None:
        self._imgui, self._session = imgui, session
        self.pinned: Source | None = None
        self._hovered: Source | None = None
        self._gain = 1.0
        self._layer = 0

    @property
    def shown(self) -> Source | None:
        """The output under the pointer, else the pinned one; None if the plan has no such output any more."""
        source = self._hovered or self.pinned
        known = {(step.name, port) for step in self._session.plan.steps for port in step.outputs}
        return source if source in known else None

    def draw(self) -> None:
        """Draw the table, and sliders for what is pinned."""
        imgui, session = self._imgui, self._session
        self._hovered = None
        self._line("pass, output", ("GPU ms", "CPU ms"))
        imgui.separator()
        for step in session.plan.steps:
            self._row(step)
        for name, why in session.plan.left_out.items():
            self._left_out(name, why)
        if self.pinned:
            _, self._gain = imgui.slider_float(
                "brightness", self._gain, 0.01, 100.0, "%.3g", imgui.SliderFlags_.logarithmic
            )
            texture = _find_texture(session.output(self.pinned))
            if texture and texture.layers > 1:
                most = texture.layers - 1
                _, self._layer = imgui.slider_int("layer", min(self._layer, most), 0, most)
            if imgui.button("back to the picture"):
                self.pinned = None

    def _line(self, name: str, times: tuple[str, str]) -> None:
        imgui = self._imgui
        imgui.text(name)
        right, width = imgui.get_content_region_avail().x, imgui.calc_text_size("0000.00 ").x
        for place, text in zip((2, 1), times, strict=True):
            imgui.same_line(right - place * width)
            imgui.text(text)

    def _row(self, step: Step) -> None:
        imgui, laps, skipped = self._imgui, self._session.laps.get(step.name), step.name in self._session.skipped
        times = (f"{laps[0]:.2f}", f"{laps[1]:.2f}") if laps else ("-", "-")
        if skipped:
            imgui.push_style_color(imgui.Col_.text, imgui.get_style_color_vec4(imgui.Col_.text_disabled))
        self._line(f"{step.name}: skipped" if skipped else step.name, times)
        if skipped:
            imgui.pop_style_color()
            imgui.set_item_tooltip("Its inputs are unchanged, so it did not run. The times are those of its last run.")
        for port, output in step.outputs.items():
            source = step.name, port
            pressed, _ = imgui.selectable(
                f"  {port}  {output.description}##{step.name}",
                self.pinned == source,
            )
            if pressed:
                self.pinned = None if self.pinned == source else source
            if imgui.is_item_hovered():
                self._hovered = source
                imgui.set_tooltip(f"{output.doc}\n{output.description}: {self._describe_size(source)}")

    def _left_out(self, name: str, why: str) -> None:
        imgui, laps = self._imgui, self._session.laps.get(name)
        saved = f"; that saves about {max(laps):.2f} ms" if laps else ""
        imgui.push_text_wrap_pos(0.0)
        imgui.text_disabled(f"{name}: left out: {why}{saved}")
        imgui.pop_text_wrap_pos()

    def _describe_size(self, source: Source) -> str:
        resource = self._session.output(source)
        if isinstance(resource, GpuBuffer):
            return (
                f"{len(resource.records)} of {resource.description.records} records, {resource.nbytes / 2**20:.2f} MiB"
            )
        textures = resource if isinstance(resource, list) else [resource] if resource else []
        if not textures:
            return "has not run yet"
        width, height = textures[0].size
        return f"{width}x{height}, {sum(t.nbytes for t in textures) / 2**20:.2f} MiB"

    def show(self, canvas: Canvas, area: Area) -> None:
        """Draw the output that is looked at over the picture."""
        texture = _find_texture(self._session.output(self.shown)) if self.shown else None
        if texture:
            layer = min(self._layer, max(texture.layers - 1, 0))
            canvas.show(texture, area.fit(texture.size), gain=self._gain, layer=layer)


def _find_texture(resource: Any) -> GpuTexture | None:
    """Return a texture, or the first of a list; None for buffers and what has not been drawn."""
    first = resource[0] if isinstance(resource, list) and resource else resource
    return first if isinstance(first, GpuTexture) else None
