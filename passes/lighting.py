"""Add up direct lights and VPLs in one fullscreen pass: lights, vpls, G-buffer, shadows -> radiance.

One shader for all lights: it reads them from uniform blocks and their shadows from one texture array. More VPLs than a
block holds are drawn block by block and added in 32-bit floats.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from deferred_ir.frame.facts import BLURRED_GLOSS, GLOSS
from deferred_ir.frame.frame import Frame, describe_environment
from deferred_ir.frame.light_culling import find_shining
from deferred_ir.frame.pass_io import Io
from deferred_ir.frame.screen_tiles import TILES, count_pairs
from deferred_ir.frame.vpl_buffer import BINDING, VPL, VPLS_PER_BLOCK, find_spread
from deferred_ir.gl.shaders import Program
from deferred_ir.graph.facts import Facts
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
    """Reflected radiance rho/pi * sum of I(w) cos V / d^2, linear RGB, and what surfaces and the background emit."""

    figures = (LIGHTS_SKIPPED,)
    Params = ShadowFilter
    inputs: ClassVar[Mapping[str, Input]] = {
        "lights": Input("the direct lights", format="light"),
        "vpls": Input("the VPLs", format="vpl"),
        "depth": Input("reversed depth", format="depth32f"),
        "normals": Input("shading and geometric normal", format="rgba16"),
        "albedo": Input("reflectance", format="rgba16f"),
        "material": Input("roughness, metallic and material", format="rgba16", optional=True),
        "reflections": Input("what gloss reflects, of which lights add no more", format="rgba32f", optional=True),
        "emission": Input("what surfaces emit", format="rgba32f", optional=True),
        "environment": Input("what shows behind everything", format="rgba32f", optional=True),
        "tiles": Input("which VPLs may light which tiles of the screen", format="rg32ui", optional=True),
        "direct": Input("light of the direct lights, instead of their maps", optional=True),
        "near_field": Input("irradiance that clamped VPLs miss", format="rgba32f", optional=True),
        "indirect": Input("irradiance from the VPLs, instead of adding them up", format="rgba32f", optional=True),
        "layout": Input("where samples stand, if `indirect` is theirs", format="layout", optional=True),
        "blend": Input("what a pixel takes of which samples", format="r32ui", optional=True),
        "lonely": Input("irradiance of lonely pixels that the filter has left out", format="rgba32f", optional=True),
        "views": Input("where the direct lights' maps are", format="view", optional=True),
        "shadows": Input("shadow atlas", format="depth32f", optional=True, linear=True, compare=">="),
        "blockers": Input("the same maps: what hides a part of a light", format="depth32f", optional=True),
    }

    def outputs(self, inputs: Mapping[str, Description | None]) -> Mapping[str, Output]:
        """Radiance in 32 bits: a half float would lose the smaller of 256 terms."""
        del inputs
        return {
            "radiance": Output(
                "radiance, linear RGB; on the background the environment's, with alpha 0",
                Texture("rgba32f"),
                transient=True,
            )
        }

    def explain_shared_error(self, facts: Facts, inputs: Mapping[str, Description | None]) -> str | None:
        """Say what VPLs do to gloss."""
        if not facts[GLOSS]:
            return None
        return None if inputs["reflections"] else BLURRED_GLOSS

    def depends(self) -> frozenset[str]:
        """The camera and, through the near plane, the scene: positions are reconstructed from the depth."""
        return frozenset({"camera", "models"})

    def execute(self, frame: Frame, io: Io) -> None:
        """Draw the frame once for each block of VPLs."""
        lights, vpls = io["lights"].records, io["vpls"].records
        views = io["views"].records if io["views"] else None
        defines = shader_variants.choose_for_pixels(frame, vpls) | self.params.defines()
        defines |= shader_variants.choose_for_lights(frame, lights, views)
        culled = io["tiles"] is not None and not frame.keep_all
        defines |= {"HAS_TILES": int(culled), "GLOSSY": int(io["material"] is not None)}
        program = io.program("lighting.frag", defines=defines)
        io.gpu.ctx.blend_func = io.gpu.ctx.ONE, io.gpu.ctx.ONE
        if io["indirect"]:
            vpls = vpls[:0]
            if io["blend"]:
                program.set(offset=read_layout(io).offset)
        if io["material"]:
            program.set(vpl_spread=find_spread(io["vpls"].records))
        if io["environment"]:
            program.set(**describe_environment(frame.scene))
        draws = _Draws(io, program)
        if not culled:
            lit = vpls[find_shining(vpls)]
            if len(lit) < len(vpls):
                draws.pack(lit)
            vpls = lit
        draws.run(len(vpls))
        if culled:
            io.count(LIGHTS_SKIPPED.name, TILES**2 * len(vpls) - count_pairs(io["tiles"].read()))


class _Draws:
    """The draws of a frame, each of a block of lights and a block of VPLs; the first is not blended."""

    def __init__(self, io: Io, program: Program) -> None:
        self._io, self._program, self._packed = io, program, None
        lights, size = io["lights"].records, io["lights"].description.block
        ends = [_count_shining(lights[start : start + size]) for start in range(0, len(lights), size)]
        self._lights = [(block, end) for block, end in enumerate(ends) if end]

    def pack(self, vpls: np.ndarray) -> None:
        """Take VPL records (n,) instead of those of the buffer."""
        packed = np.zeros(max(-(-len(vpls) // VPLS_PER_BLOCK), 1) * VPLS_PER_BLOCK, VPL)
        packed[: len(vpls)] = vpls
        self._packed = self._io.gpu.uniforms(packed.tobytes())

    def run(self, count: int) -> None:
        """Draw `count` VPLs, and all lights."""
        io, program = self._io, self._program
        blocks = -(-count // VPLS_PER_BLOCK)
        for number in range(max(blocks, len(self._lights), 1)):
            light_block, direct = self._lights[number] if number < len(self._lights) else (0, 0)
            io["lights"].bind(light_block)
            if io["views"]:
                io["views"].bind(light_block)
            block = number if number < blocks else 0
            if self._packed:
                nbytes = VPLS_PER_BLOCK * VPL.itemsize
                self._packed.bind_to_uniform_block(BINDING, offset=block * nbytes, size=nbytes)
            else:
                io["vpls"].bind(block)
            if number:
                io.gpu.ctx.enable(io.gpu.ctx.BLEND)
            here = min(count - block * VPLS_PER_BLOCK, VPLS_PER_BLOCK) if number < blocks else 0
            program.set(first=number == 0, light_count=direct, count=here, block=block)
            program.draw_fullscreen()


def _count_shining(lights: np.ndarray) -> int:
    """Return how many of the LIGHT records (n,) must be looped over: up to the last that has power."""
    lit = np.flatnonzero(find_shining(lights))
    return int(lit[-1]) + 1 if len(lit) else 0


PASS = Lighting
