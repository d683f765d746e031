"""Shadow maps in the lower left corner: the spotlight's or that of any VPL, whichever pass draws them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..gl.resources import GpuTexture
from .canvas import Area, Canvas
from .controls import Controls
from .session import Session

SHARE = 0.33
"""Of the picture's shorter side."""


class MapsPanel:
    """Which map is shown, and how bright."""

    def __init__(self, imgui: Any, session: Session, controls: Controls) -> None:
        self._imgui, self._session, self._controls = imgui, session, controls
        self.light, self.intensity, self.linear = 0, 1.0, True

    def _tiles(self) -> tuple[tuple[str, str], list[Mapping[str, Any]]] | None:
        """The output that holds the maps, and the sub-pass of each light: those that name layer, tile and size."""
        for step in self._session.plan.steps:
            tiles = list(step.work.subpasses(step.descriptions))
            if tiles and {"light", "layer", "tile", "size"} <= tiles[0].keys():
                return (step.name, next(iter(step.outputs))), tiles
        return None

    def draw(self) -> None:
        """The switch and its sliders."""
        imgui, switches = self._imgui, self._controls.switches
        found = self._tiles()
        if not found:
            imgui.text_disabled("this graph draws no atlas of maps")
            return
        _, switches["map"] = imgui.checkbox("in the corner (M)", switches["map"])
        most = len(found[1]) - 1
        _, self.light = imgui.slider_int(
            "light", min(self.light, most), 0, most, found[1][min(self.light, most)]["light"]
        )
        imgui.set_item_tooltip("0 is the spotlight, n the VPL of number n - 1")
        _, self.intensity = imgui.slider_float(
            "intensity", self.intensity, 0.01, 100.0, "%.3g", imgui.SliderFlags_.logarithmic
        )
        _, self.linear = imgui.checkbox("linear depth", self.linear)
        imgui.set_item_tooltip("brighter is farther; else what is near is bright")

    def show(self, canvas: Canvas, area: Area) -> None:
        """Draw the chosen map over the picture's corner."""
        found = self._tiles() if self._controls.switches["map"] else None
        texture = self._session.output(found[0]) if found else None
        if not found or not isinstance(texture, GpuTexture):
            return
        tile = found[1][min(self.light, len(found[1]) - 1)]
        row = texture.size[0] // tile["size"]
        y, x = divmod(tile["tile"], row)
        part = Area(x * tile["size"], y * tile["size"], tile["size"], tile["size"])
        edge = max(round(SHARE * min(area.width, area.height)), 1)
        corner = Area(area.x, area.y, edge, edge)
        gain = self.intensity * (1.0 if self.linear else 0.3)
        canvas.show(texture, corner, layer=tile["layer"], part=part, gain=gain, linear=self.linear)
