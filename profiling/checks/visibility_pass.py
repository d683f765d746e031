"""A pass that asks the shadow maps about one light a pixel: lights, G-buffer, atlas -> pairs.

It reads the maps through the same GLSL as `lighting`, so what it tells is what a picture shows.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar, Literal

from deferred_ir.frame.frame import Frame
from deferred_ir.frame.pass_io import Io
from deferred_ir.graph.params import param
from deferred_ir.graph.pass_base import Pass
from deferred_ir.graph.ports import Description, Input, Output, Texture
from deferred_ir.scene.lights.spot import LIGHTS_PER_BLOCK

FOLDER = Path(__file__).parent


@dataclass(frozen=True)
class Params:
    """Parameters of the pairs."""

    lights_of: Literal["spotlight", "vpls"] = param("vpls", doc="Which lights pixels are paired with.")


class VisibilityPairs(Pass):
    """Pairs each pixel with the spotlight, or with a VPL that a hash of pixel and seed draws."""

    Params = Params
    shader_folder = FOLDER
    inputs: ClassVar[Mapping[str, Input]] = {
        "lights": Input("the spotlight, then the VPLs", format="light"),
        "depth": Input("reversed depth", format="depth32f"),
        "normals": Input("shading and geometric normal", format="rgba16"),
        "shadows": Input("shadow atlas", format="depth32f", linear=True, compare=">="),
    }

    def outputs(self, inputs: Mapping[str, Description | None]) -> Mapping[str, Output]:
        """Both in 32 bits: a ray has to find the pixel's surface again."""
        del inputs
        pairs = (
            "number of the light, visibility, luminance of the unshadowed irradiance, reversed depth; 0 without a light"
        )
        return {
            "pairs": Output(pairs, Texture("rgba32f")),
            "facing": Output("geometric normal", Texture("rgba32f")),
        }

    def execute(self, frame: Frame, io: Io) -> None:
        """One fullscreen draw a block of lights; each pixel is drawn by the block that has its light."""
        lights, spotlight = io["lights"], self.params.lights_of == "spotlight"
        io.framebuffer.clear_color(0)
        io.framebuffer.clear_color(1)
        total = len(lights.records)
        if not spotlight and total == 1:
            return  # no VPL lives
        program = io.program("visibility.frag")
        program.set(spotlight=spotlight, total=total, seed=frame.seed % 2**32)
        for start in range(0, 1 if spotlight else total, LIGHTS_PER_BLOCK):
            lights.bind_uniform(1, start // LIGHTS_PER_BLOCK)
            program.set(start=start)
            program.draw_fullscreen()
