"""Add up the spotlight and all VPLs in one fullscreen pass: lights, G-buffer, shadows -> radiance.

One shader for all lights: it reads them from a uniform block and their shadows from one texture array. More lights than
a block holds are drawn block by block and added in 32-bit floats.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from deferred_ir.frame.frame import Frame
from deferred_ir.frame.light_culling import last_shining
from deferred_ir.frame.pass_io import Io
from deferred_ir.frame.screen_tiles import FEWEST, Tiles, draws
from deferred_ir.gl.shaders import Program
from deferred_ir.graph.figures import Figure
from deferred_ir.graph.pass_base import Pass
from deferred_ir.graph.ports import Description, Input, Output, Texture
from deferred_ir.scene.lights.spot import LIGHTS_PER_BLOCK
from deferred_ir.shadows import shader_variants

LIGHTS_SKIPPED = Figure(
    "lights_skipped",
    "Pairs of a screen tile and a light that were not shaded.",
    left_out=("{n} pairs of tile and light", "the tile of the screen lies behind the light, or outside its cone"),
)


class Lighting(Pass):
    """Reflected radiance rho/pi * sum of I(w) cos V / d^2, linear RGB."""

    figures = (LIGHTS_SKIPPED,)
    inputs: ClassVar[Mapping[str, Input]] = {
        "lights": Input("the spotlight, then the VPLs", format="light"),
        "depth": Input("reversed depth", format="depth32f"),
        "normals": Input("shading and geometric normal", format="rgba16"),
        "albedo": Input("reflectance", format="rgba16f"),
        "spotlight": Input("irradiance from the spotlight over its emission, instead of a map", "r32f", optional=True),
        "near_field": Input("irradiance that clamped VPLs miss", format="rgba32f", optional=True),
        "indirect": Input("irradiance from the VPLs, instead of adding them up", format="rgba32f", optional=True),
        "thin": Input("irradiance where the filter has left it out", format="rgba32f", optional=True),
        "shadows": Input("shadow atlas", format="depth32f", optional=True, linear=True, compare=">="),
        "blockers": Input("the same maps: what hides a part of the spotlight's disc", format="depth32f", optional=True),
    }

    def outputs(self, inputs: Mapping[str, Description | None]) -> Mapping[str, Output]:
        """Radiance in 32 bits: 256 terms drown in a half float."""
        del inputs
        return {
            "radiance": Output(
                "reflected radiance, linear RGB; 0 on the background", Texture("rgba32f"), transient=True
            )
        }

    def depends(self) -> frozenset[str]:
        """Positions come back from the depth, which the near plane scales."""
        return frozenset({"camera", "models"})

    def execute(self, frame: Frame, io: Io) -> None:
        """One fullscreen draw a block of lights, or one a tile of the screen with the lights that may reach it."""
        ctx, lights = io.gpu.ctx, io["lights"]
        records = lights.records[:1] if io["indirect"] else lights.records
        defines = shader_variants.of_pixels(frame, lights.records[1:]) | shader_variants.of_spotlight(frame, records)
        program = io.program("lighting.frag", defines=defines)
        ctx.blend_func = ctx.ONE, ctx.ONE
        # A GPU would wait for the depth, and has a light's arithmetic for less than a draw.
        if len(records) > FEWEST and io.gpu.device.kind == "software" and not frame.keep_all:
            self._draw_tiles(frame, io, program, records)
            return
        for start in range(0, len(records), LIGHTS_PER_BLOCK):
            first = int(start == 0)
            count = last_shining(records[start + first : start + LIGHTS_PER_BLOCK])
            if not first and not count:
                continue
            lights.bind_uniform(1, start // LIGHTS_PER_BLOCK)
            program.set(first=first, count=first + count)
            program.draw_fullscreen()
            ctx.enable(ctx.BLEND)

    def _draw_tiles(self, frame: Frame, io: Io, program: Program, records: np.ndarray) -> None:
        """The same light by light, without those that a tile lies behind."""
        tiles = Tiles.of(io["depth"].read()[..., 0], frame.scene.camera, frame.near)
        packed, made = draws(tiles, records)
        io.gpu.ctx.finish()  # maps that are still being drawn would be timed with what comes after this pass
        buffer = io.gpu.uniforms(packed.tobytes())
        io.framebuffer.clear_color()
        size = LIGHTS_PER_BLOCK * records.itemsize
        for draw in made:
            buffer.bind_to_uniform_block(1, offset=draw.start * records.itemsize, size=size)
            io.gpu.scissor(draw.rectangle)
            if not draw.first:
                io.gpu.ctx.enable(io.gpu.ctx.BLEND)
            program.set(first=draw.first, count=draw.count)
            program.draw_fullscreen()
        io.count(LIGHTS_SKIPPED.name, len(tiles.rectangles) * (len(records) - 1) - sum(d.count - d.first for d in made))


PASS = Lighting
