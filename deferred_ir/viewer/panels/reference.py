"""Compare with reference: a progress bar, then the picture split in two, and relMSE."""

from __future__ import annotations

from typing import Any

from deferred_ir.gl.textures import GpuTexture
from deferred_ir.graph.graph import Plan
from deferred_ir.graph.ports import Texture
from deferred_ir.viewer.canvas import Area, Canvas
from deferred_ir.viewer.reference_job import Truth
from deferred_ir.viewer.session import Session

SPP = (16, 64, 256, 1024)


class TruthPanel:
    """The reference at the right of the split, the picture at its left, both with the exposure of the picture."""

    def __init__(self, imgui: Any, session: Session) -> None:
        self._imgui, self._session = imgui, session
        self.truth = Truth()
        self._spp, self.split, self.at = 1, True, 0.5
        self._texture: GpuTexture | None = None
        self._made: tuple[Any, Plan, float | None] | None = None
        self._stops: tuple[int, float | None] = -1, None
        self._seen = -1

    @property
    def _fits(self) -> bool:
        session = self._session
        return self.truth.fits(session.shown, session.size, session.bounces)

    def start(self) -> None:
        """Trace a reference of what is on screen."""
        session = self._session
        self.truth.start(session.shown, session.size, SPP[self._spp], session.bounces)

    def draw(self) -> None:
        """Controls and figures."""
        imgui, truth = self._imgui, self.truth
        _, self._spp = imgui.combo("paths a pixel", self._spp, [str(n) for n in SPP])
        if truth.running:
            imgui.progress_bar(truth.progress, imgui.ImVec2(-1, 0), f"{truth.progress:.0%}")
            if imgui.button("stop"):
                truth.stop()
        elif imgui.button("compare with reference"):
            self.start()
        if truth.error:
            imgui.text_wrapped(truth.error)
        if truth.result and not self._fits:
            imgui.text_wrapped("the reference is of another view or light; trace it again")
        if self._fits:
            _, self.split = imgui.checkbox("split view", self.split)
            _, self.at = imgui.slider_float("split", self.at, 0.0, 1.0, "%.2f")

    @property
    def text(self) -> str:
        """How far the picture is from its reference, for the status line."""
        if not self._fits:
            return ""
        found = self._distance()
        return "nothing is lit" if found is None else f"relMSE {found:.3g} (trimmed) from the reference"

    def _distance(self) -> float | None:
        changed, self._seen = self._session.version != self._seen, self._session.version
        return self.truth.distance(lambda: self._session.image().radiance, changed)

    def show(self, canvas: Canvas, area: Area) -> None:
        """Draw the reference over the right part of the picture, through the graph's own tone map."""
        if not (self.split and self._fits) or self._session.size != (area.width, area.height):
            return
        result, plan = self.truth.result, self._session.plan
        assert result
        if self._texture is None or self._texture.size != self._session.size:
            self.release()
            self._texture = GpuTexture(self._session.renderer.gpu, Texture("rgba8"), self._session.size)
        if self._stops[0] != self._session.version:
            self._stops = self._session.version, self._session.exposure()
        made = result, plan, self._stops[1]
        if self._made != made:
            self._texture.upload(self._session.toned(result.radiance, self._stops[1]))
            self._made = made
        canvas.show(self._texture, area, split=round(self.at * area.width))

    def release(self) -> None:
        """Give the texture back."""
        if self._texture:
            self._texture.release()
        self._texture = self._made = None

    def close(self) -> None:
        """End the tracing, too."""
        self.truth.stop()
        self.release()
