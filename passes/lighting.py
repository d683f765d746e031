"""Add up direct lights and VPLs in one fullscreen pass: lights, vpls, G-buffer, shadows -> radiance.

One shader for all lights: it reads them from uniform blocks and their shadows from one texture array. More VPLs than a
block holds are drawn block by block and added in 32-bit floats.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from deferred_ir.frame.frame import Frame
from deferred_ir.frame.light_culling import find_shining
from deferred_ir.frame.pass_io import Io
from deferred_ir.frame.screen_tiles import TILES, count_pairs
from deferred_ir.frame.vpl_buffer import BINDING, VPL, VPLS_PER_BLOCK
from deferred_ir.gl.shaders import Program
from deferred_ir.graph.figures import Figure
from deferred_ir.graph.pass_base import Pass
from deferred_ir.graph.ports import Description, Input, Output, Texture
from deferred_ir.pool.samples import read_layout
from deferred_ir.shadows import shader_variants
from deferred_ir.shadows.filter import ShadowFilter

LIGHTS_SKIPPED = Figure(
    "lights_skipped",
    "Pairs of a screen tile and a light that were not shaded.",
    left_out=(
        "{n} pairs of tile and light",
        "the tile shows nothing in front of the light and inside its cone",
    ),
)


class Lighting(Pass):
    """Reflected radiance rho/pi * sum of I(w) cos V / d^2, linear RGB."""

    figures = (LIGHTS_SKIPPED,)
    Params = ShadowFilter
    inputs: ClassVar[Mapping[str, Input]] = {
        "lights": Input("the direct lights", format="light"),
        "vpls": Input("the VPLs", format="vpl"),
        "depth": Input("reversed depth", format="depth32f"),
        "normals": Input("shading and geometric normal", format="rgba16"),
        "albedo": Input("reflectance", format="rgba16f"),
        "tiles": Input("which VPLs may light which tiles of the screen", format="rg32ui", optional=True),
        "spotlight": Input("irradiance from the spotlight over its emission, instead of a map", "r32f", optional=True),
        "near_field": Input("irradiance that clamped VPLs miss", format="rgba32f", optional=True),
        "indirect": Input("irradiance from the VPLs, instead of adding them up", format="rgba32f", optional=True),
        "layout": Input("where samples stand, if `indirect` is theirs", format="layout", optional=True),
        "blend": Input("what a pixel takes of which samples", format="r32ui", optional=True),
        "lonely": Input("irradiance of lonely pixels that the filter has left out", format="rgba32f", optional=True),
        "views": Input("where the direct lights' maps are", format="view", optional=True),
        "shadows": Input("shadow atlas", format="depth32f", optional=True, linear=True, compare=">="),
        "blockers": Input("the same maps: what hides a part of the spotlight's disc", format="depth32f", optional=True),
    }

    def outputs(self, inputs: Mapping[str, Description | None]) -> Mapping[str, Output]:
        """Radiance in 32 bits: a half float would lose the smaller of 256 terms."""
        del inputs
        return {
            "radiance": Output(
                "reflected radiance, linear RGB; 0 on the background", Texture("rgba32f"), transient=True
            )
        }

    def depends(self) -> frozenset[str]:
        """The camera and, through the near plane, the scene: positions are reconstructed from the depth."""
        return frozenset({"camera", "models"})

    def execute(self, frame: Frame, io: Io) -> None:
        """Draw the frame once for each block of VPLs."""
        lights, vpls = io["lights"], io["vpls"].records
        lights.bind()
        if io["views"]:
            io["views"].bind()
        views = io["views"].records if io["views"] else None
        defines = shader_variants.choose_for_pixels(frame, vpls) | self.params.defines()
        defines |= shader_variants.choose_for_lights(frame, lights.records, views)
        culled = io["tiles"] is not None and not frame.keep_all
        program = io.program("lighting.frag", defines=defines | {"HAS_TILES": int(culled)})
        io.gpu.ctx.blend_func = io.gpu.ctx.ONE, io.gpu.ctx.ONE
        if io["indirect"]:
            vpls = vpls[:0]
            if io["blend"]:
                program.set(offset=read_layout(io).offset)
        if culled:
            self._draw_culled(io, program, len(vpls))
        else:
            self._draw_shining(io, program, vpls)

    def _draw_culled(self, io: Io, program: Program, count: int) -> None:
        """Draw each block of the `count` VPLs; pixels take those of their tile."""
        for block in range(max(-(-count // VPLS_PER_BLOCK), 1)):
            io["vpls"].bind(block)
            program.set(block=block)
            self._draw(io, program, first=block == 0, count=min(count - block * VPLS_PER_BLOCK, VPLS_PER_BLOCK))
        io.count(LIGHTS_SKIPPED.name, TILES**2 * count - count_pairs(io["tiles"].read()))

    def _draw_shining(self, io: Io, program: Program, vpls: np.ndarray) -> None:
        """Draw the VPLs that have power, block by block."""
        lit = vpls[find_shining(vpls)]
        blocks = max(-(-len(lit) // VPLS_PER_BLOCK), 1)
        packed = np.zeros(blocks * VPLS_PER_BLOCK, VPL)
        packed[: len(lit)] = lit
        buffer = io.gpu.uniforms(packed.tobytes()) if len(lit) < len(vpls) else None
        for start in range(0, max(len(lit), 1), VPLS_PER_BLOCK):
            if buffer:
                buffer.bind_to_uniform_block(BINDING, offset=start * VPL.itemsize, size=VPLS_PER_BLOCK * VPL.itemsize)
            else:
                io["vpls"].bind(start // VPLS_PER_BLOCK)
            self._draw(io, program, first=start == 0, count=min(len(lit) - start, VPLS_PER_BLOCK))

    def _draw(self, io: Io, program: Program, *, first: bool, count: int) -> None:
        """Draw `count` VPLs of the bound block. The first draw of a pixel adds the direct lights; later draws blend."""
        if not first:
            io.gpu.ctx.enable(io.gpu.ctx.BLEND)
        program.set(direct=len(io["lights"].records) if first else 0, count=count)
        program.draw_fullscreen()


PASS = Lighting
