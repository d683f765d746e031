"""A pass that looks up one light a pixel in the shadow maps: lights, vpls, G-buffer, atlas -> pairs.

It reads the maps through the same GLSL as `lighting`, so its answers are those of an image.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar, Literal

from deferred_ir.frame.frame import Frame
from deferred_ir.frame.pass_io import Io
from deferred_ir.frame.vpl_buffer import VPLS_PER_BLOCK
from deferred_ir.graph.params import param
from deferred_ir.graph.pass_base import Pass
from deferred_ir.graph.ports import Description, Input, Output, Texture
from deferred_ir.shadows import shader_variants
from deferred_ir.shadows.filter import ShadowFilter

FOLDER = Path(__file__).parent


@dataclass(frozen=True)
class Params(ShadowFilter):
    """Parameters of the pairs."""

    lights_of: Literal["direct", "vpls"] = param("vpls", doc="Which lights pixels are paired with.")


class VisibilityPairs(Pass):
    """Pairs each pixel with the first direct light, or with a VPL chosen by a hash of pixel and seed."""

    Params = Params
    shader_folder = FOLDER
    inputs: ClassVar[Mapping[str, Input]] = {
        "lights": Input("the direct lights", format="light"),
        "vpls": Input("the VPLs", format="vpl"),
        "views": Input("where the direct lights' maps are", format="view"),
        "depth": Input("reversed depth", format="depth32f"),
        "normals": Input("shading and geometric normal", format="rgba16"),
        "shadows": Input("shadow atlas", format="depth32f", linear=True, compare=">="),
    }

    def outputs(self, inputs: Mapping[str, Description | None]) -> Mapping[str, Output]:
        """Declare both outputs with 32 bits: a ray has to find the pixel's surface again."""
        del inputs
        pairs = "number of light or VPL, visibility, unshadowed luminance, reversed depth; 0 without a light"
        return {
            "pairs": Output(pairs, Texture("rgba32f")),
            "facing": Output("geometric normal", Texture("rgba32f")),
        }

    def execute(self, frame: Frame, io: Io) -> None:
        """Draw one fullscreen triangle a block of VPLs; a pixel is drawn by the block with its light."""
        vpls, direct = io["vpls"], self.params.lights_of == "direct"
        io.framebuffer.clear_color(0)
        io.framebuffer.clear_color(1)
        total = len(vpls.records)
        if not direct and total == 0:
            return  # there is no VPL
        io["lights"].bind()
        io["views"].bind()
        defines = shader_variants.choose_for_lights(frame, io["lights"].records, io["views"].records)
        defines |= shader_variants.choose_for_pixels(frame, vpls.records) | self.params.defines()
        program = io.program("visibility.frag", defines=defines | {"DISC": 0})
        program.set(direct=direct, total=total, seed=frame.seed % 2**32)
        for start in range(0, 1 if direct else total, VPLS_PER_BLOCK):
            vpls.bind(start // VPLS_PER_BLOCK)
            program.set(start=start)
            program.draw_fullscreen()
