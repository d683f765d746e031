"""Compare with reference: a progress bar, then the picture split in two, and relMSE."""

from __future__ import annotations

from typing import Any

from deferred_ir.gl.textures import GpuTexture
from deferred_ir.graph.graph import Plan
from deferred_ir.graph.ports import Texture
from deferred_ir.graph.roles import find_parameters
from deferred_ir.viewer.canvas import Area, Canvas
from deferred_ir.viewer.reference_job import ReferenceJob
from deferred_ir.viewer.session import Session
from deferred_ir.viewer.tone_map import find_exposure, tone_map

SPP = (16, 64, 256, 1024)


class ReferencePanel:
    """The reference at the right of the split, the picture at its left, both with the exposure of the picture."""

    def __init__(self, imgui: Any, session: Session) -> None:
        self._imgui, self._session = imgui, session
        self.job = ReferenceJob()
        self._spp, self.split, self.at = 1, True, 0.5
        self._texture: GpuTexture | None = None
        self._content: tuple[Any, Plan, float | None] | None = None
        self._stops: tuple[int, float | None] = -1, None
        self._measured_version = -1

    @property
    def _matches(self) -> bool:
        """Whether there is a reference of what is on screen."""
        return self.job.matches(self._session.shown, self._session.size, self._bounces)

    @property
    def _bounces(self) -> int:
        """Bounces of indirect light that the graph makes."""
        return max(find_parameters(self._session.renderer.graph(), "bounces").values(), default=1)

    def start(self) -> None:
        """Trace a reference of what is on screen."""
        self.job.start(self._session.shown, self._session.size, SPP[self._spp], self._bounces)

    def draw(self) -> None:
        """Draw controls and figures."""
        imgui, job = self._imgui, self.job
        _, self._spp = imgui.combo("paths a pixel", self._spp, [str(n) for n in SPP])
        if job.running:
            imgui.progress_bar(job.progress, imgui.ImVec2(-1, 0), f"{job.progress:.0%}")
            if imgui.button("stop"):
                job.stop()
        elif imgui.button("compare with reference"):
            self.start()
        if job.error:
            imgui.text_wrapped(job.error)
        if job.result and not self._matches:
            imgui.text_wrapped("the reference shows another view or light; trace it again")
        if self._matches:
            _, self.split = imgui.checkbox("split view", self.split)
            _, self.at = imgui.slider_float("split", self.at, 0.0, 1.0, "%.2f")

    @property
    def text(self) -> str:
        """How far the picture is from its reference, for the status line; "" without one."""
        if not self._matches:
            return ""
        error = self._measure()
        return "nothing is lit" if error is None else f"relMSE {error:.3g} (trimmed) from the reference"

    def _measure(self) -> float | None:
        version = self._session.version
        changed, self._measured_version = version != self._measured_version, version
        return self.job.measure(lambda: self._session.image().radiance, changed)

    def show(self, canvas: Canvas, area: Area) -> None:
        """Draw the reference over the right part of the picture, through the graph's own tone map."""
        if not (self.split and self._matches) or self._session.size != (area.width, area.height):
            return
        result, plan = self.job.result, self._session.plan
        assert result
        if self._texture is None or self._texture.size != self._session.size:
            self.release()
            self._texture = GpuTexture(self._session.renderer.gpu, Texture("rgba8"), self._session.size)
        if self._stops[0] != self._session.version:
            self._stops = self._session.version, find_exposure(self._session)
        content = result, plan, self._stops[1]
        if self._content != content:
            self._texture.upload(tone_map(self._session, result.radiance, self._stops[1]))
            self._content = content
        canvas.show(self._texture, area, split=round(self.at * area.width))

    def release(self) -> None:
        """Give the texture back."""
        if self._texture:
            self._texture.release()
        self._texture = self._content = None

    def close(self) -> None:
        """End the tracing, and give the texture back."""
        self.job.stop()
        self.release()
