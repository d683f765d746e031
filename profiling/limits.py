"""Passes that do the least that a pass of the graph `deferred` must do, for profiling/bench.py to hold it against."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import ClassVar

from deferred_ir.frame import Frame
from deferred_ir.graph import Description, Input, Output, Pass, Texture
from deferred_ir.io import Io
from deferred_ir.lights import LIGHTS_PER_BLOCK

FOLDER = Path(__file__).parent


class LimitLighting(Pass):
    """One projection and one shadow comparison for each pixel and light; the output counts the lights that arrive."""

    shader_folder = FOLDER
    inputs: ClassVar[Mapping[str, Input]] = {
        "lights": Input("the spotlight, then the VPLs", format="light"),
        "depth": Input("reversed depth", format="depth32f"),
        "shadows": Input("shadow atlas", format="depth32f", linear=True, compare=">="),
    }

    def outputs(self, inputs: Mapping[str, Description | None]) -> Mapping[str, Output]:
        """The target that lighting has."""
        del inputs
        return {"radiance": Output("lights that reach the pixel; 0 on the background", Texture("rgba32f"))}

    def execute(self, frame: Frame, io: Io) -> None:
        """One fullscreen draw a block of lights."""
        del frame
        ctx, lights = io.gpu.ctx, io["lights"]
        program = io.program("limit_lighting.frag")
        ctx.blend_func = ctx.ONE, ctx.ONE
        for start in range(0, len(lights.records), LIGHTS_PER_BLOCK):
            lights.bind_uniform(1, start // LIGHTS_PER_BLOCK)
            program.set(first=int(start == 0), count=min(LIGHTS_PER_BLOCK, len(lights.records) - start))
            program.draw_fullscreen()
            ctx.enable(ctx.BLEND)


LIMITS: Mapping[str, type[Pass]] = {"limit_lighting": LimitLighting}
"""By the name of their type; a graph file beside this one, of the same name, puts each in its place."""
