"""Shadow maps in the lower left corner: the spotlight's or that of any VPL, whichever pass draws them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from deferred_ir.frame.light_culling import shining
from deferred_ir.gl.textures import GpuTexture
from deferred_ir.graph.graph import Step
from deferred_ir.graph.ports import Texture
from deferred_ir.viewer.canvas import Area, Canvas
from deferred_ir.viewer.controls import Controls
from deferred_ir.viewer.panels.light_frames import records
from deferred_ir.viewer.session import Session

SHARE = 0.33
"""Of the picture's shorter side."""


@dataclass(frozen=True)
class Map:
    """Where a light's map is: `texture`, a layer of it and a part of that, None for all."""

    light: str
    state: str
    texture: GpuTexture
    layer: int = 0
    part: Area | None = None


class MapsPanel:
    """Which map is shown, and how bright."""

    def __init__(self, imgui: Any, session: Session, controls: Controls) -> None:
        self._imgui, self._session, self._controls = imgui, session, controls
        self.light, self.intensity, self.linear = 0, 1.0, True

    def _maps(self) -> list[Map]:
        """Of the last frame: tiles of an atlas, or textures of their own, whichever pass draws them."""
        for step in self._session.drawn.steps if self._session.drawn else ():
            found = self._tiles(step) or self._textures(step)
            if found:
                return found
        return []

    def _tiles(self, step: Step) -> list[Map]:
        """From the sub-passes that name layer, tile and size."""
        state = self._session.renderer.executor.state(step.name)
        texture = self._session.output((step.name, next(iter(step.outputs), "")))
        if state is None or not isinstance(texture, GpuTexture):
            return []
        found = []
        for part in step.work.subpasses(step.descriptions, state):
            if {"light", "layer", "tile", "size"} <= part.keys():
                y, x = divmod(part["tile"], texture.size[0] // part["size"])
                place = Area(x * part["size"], y * part["size"], part["size"], part["size"])
                found.append(Map(part["light"], part["state"], texture, part["layer"], place))
        return found

    def _textures(self, step: Step) -> list[Map]:
        """From outputs that are lists of depth textures: the spotlight's, then one for each tile."""
        textures: list[GpuTexture] = []
        for port, output in step.outputs.items():
            found = self._session.output((step.name, port))
            if isinstance(output.description, Texture) and isinstance(found, list) and found[0].format.depth:
                textures += found
        lights = records(self._session)
        if not textures or lights is None:
            return []
        tiles = sorted(lights["tile"][shining(lights)].astype(int).tolist())
        return [Map(f"vpl {tile}" if tile >= 0 else "spotlight", "", textures[tile + 1]) for tile in tiles]

    def edge(self, area: Area) -> int:
        """Pixels that the map covers in both directions, 0 where none is shown."""
        shown = self._controls.switches["map"] and self._maps()
        return max(round(SHARE * min(area.width, area.height)), 1) if shown else 0

    def draw(self) -> None:
        """The switch and its sliders."""
        imgui, switches = self._imgui, self._controls.switches
        maps = self._maps()
        if not maps:
            imgui.text_disabled("this graph draws no shadow maps")
            return
        _, switches["map"] = imgui.checkbox("in the corner (M)", switches["map"])
        most = len(maps) - 1
        chosen = maps[min(self.light, most)]
        told = f"{chosen.light}, {chosen.state}" if chosen.state else chosen.light
        _, self.light = imgui.slider_int("light", min(self.light, most), 0, most, told)
        imgui.set_item_tooltip("0 is the spotlight; then the VPLs that there are, by their tiles")
        _, self.intensity = imgui.slider_float(
            "intensity", self.intensity, 0.01, 100.0, "%.3g", imgui.SliderFlags_.logarithmic
        )
        _, self.linear = imgui.checkbox("linear depth", self.linear)
        imgui.set_item_tooltip("brighter is farther; else what is near is bright")

    def show(self, canvas: Canvas, area: Area) -> None:
        """Draw the chosen map over the picture's corner."""
        maps = self._maps() if self._controls.switches["map"] else []
        if not maps:
            return
        chosen = maps[min(self.light, len(maps) - 1)]
        edge = self.edge(area)
        corner = Area(area.x, area.y, edge, edge)
        gain = self.intensity * (1.0 if self.linear else 0.3)
        canvas.show(chosen.texture, corner, layer=chosen.layer, part=chosen.part, gain=gain, linear=self.linear)
