"""Shadow maps in the lower left corner: those of any light or VPL, whichever pass draws them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from deferred_ir.frame.light_culling import find_shining
from deferred_ir.gl.textures import GpuTexture
from deferred_ir.graph.graph import Step
from deferred_ir.graph.ports import Texture
from deferred_ir.viewer.canvas import Area, Canvas
from deferred_ir.viewer.controls import Controls
from deferred_ir.viewer.panels.light_axes import find_records
from deferred_ir.viewer.session import Session

EDGE = 0.33
"""Of the map in the corner, in shorter sides of the picture."""


@dataclass(frozen=True)
class Map:
    """A light's shadow map: an area of a layer of a texture, None for all. state: whether it was redrawn, if known."""

    light: str
    state: str
    texture: GpuTexture
    layer: int = 0
    area: Area | None = None


class ShadowMapsPanel:
    """Chooses which map is shown, and how bright."""

    def __init__(self, imgui: Any, session: Session, controls: Controls) -> None:
        self._imgui, self._session, self._controls = imgui, session, controls
        self.light, self.intensity, self.linear = 0, 1.0, True

    def _find_maps(self) -> list[Map]:
        """Return the maps of the last frame: tiles of an atlas, or textures of their own, whichever pass draws them."""
        for step in self._session.drawn.steps if self._session.drawn else ():
            maps = self._find_tiles(step) or self._find_textures(step)
            if maps:
                return maps
        return []

    def _find_tiles(self, step: Step) -> list[Map]:
        """Return the tiles that the sub-passes of a step name by layer, tile and size."""
        state = self._session.renderer.executor.state(step.name)
        texture = self._session.output((step.name, next(iter(step.outputs), "")))
        if state is None or not isinstance(texture, GpuTexture):
            return []
        maps = []
        for subpass in step.work.subpasses(step.descriptions, state):
            if {"light", "layer", "tile", "size"} <= subpass.keys():
                size = subpass["size"]
                y, x = divmod(subpass["tile"], texture.size[0] // size)
                left, bottom = subpass.get("corner", (x * size, y * size))
                place = Area(left, bottom, size, size)
                maps.append(Map(subpass["light"], subpass["state"], texture, subpass["layer"], place))
        return maps

    def _find_textures(self, step: Step) -> list[Map]:
        """Return the maps in lists of textures that a step writes, one each: direct lights, then VPLs' tiles."""
        lists: list[list[GpuTexture]] = []
        for port, output in step.outputs.items():
            written = self._session.output((step.name, port))
            if isinstance(output.description, Texture) and isinstance(written, list) and written[0].format.depth:
                lists.append(written)
        lights, vpls = (find_records(self._session, kind) for kind in ("light", "vpl"))
        if len(lists) != 2 or lights is None or vpls is None:
            return []
        owners = np.repeat(np.arange(len(lights)), lights["views"].astype(int))
        views = np.flatnonzero(find_shining(lights)[owners]).tolist()
        tiles = sorted(vpls["tile"][find_shining(vpls)].astype(int).tolist())
        maps = [Map(f"light {owners[view] + 1}", "", lists[0][view]) for view in views]
        return maps + [Map(f"vpl {tile}", "", lists[1][tile]) for tile in tiles]

    def edge(self, area: Area) -> int:
        """Return width and height in pixels of the map in the corner, 0 if none is shown."""
        shown = self._controls.switches["map"] and self._find_maps()
        return max(round(EDGE * min(area.width, area.height)), 1) if shown else 0

    def draw(self) -> None:
        """Draw the switch and the sliders."""
        imgui, switches = self._imgui, self._controls.switches
        maps = self._find_maps()
        if not maps:
            imgui.text_disabled("this graph draws no shadow maps")
            return
        _, switches["map"] = imgui.checkbox("in the corner (M)", switches["map"])
        most = len(maps) - 1
        chosen = maps[min(self.light, most)]
        label = f"{chosen.light}, {chosen.state}" if chosen.state else chosen.light
        _, self.light = imgui.slider_int("light", min(self.light, most), 0, most, label)
        imgui.set_item_tooltip("those of lights, unless rays replace them; the VPLs follow by the tiles of their maps")
        _, self.intensity = imgui.slider_float(
            "intensity", self.intensity, 0.01, 100.0, "%.3g", imgui.SliderFlags_.logarithmic
        )
        _, self.linear = imgui.checkbox("linear depth", self.linear)
        imgui.set_item_tooltip("on: brighter is farther; off: brighter is nearer")

    def show(self, canvas: Canvas, area: Area) -> None:
        """Draw the chosen map over the picture's corner."""
        maps = self._find_maps() if self._controls.switches["map"] else []
        if not maps:
            return
        chosen = maps[min(self.light, len(maps) - 1)]
        edge = self.edge(area)
        corner = Area(area.x, area.y, edge, edge)
        gain = self.intensity * (1.0 if self.linear else 0.3)
        canvas.show(chosen.texture, corner, layer=chosen.layer, part=chosen.area, gain=gain, linear=self.linear)
