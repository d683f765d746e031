"""Forward shading, the assignment's method and the baseline: draw the scene once for each light and blend.

lights, vpls, depth and primitives of visible_faces, a plain depth map for each light -> radiance. Positions are
interpolated from the vertices; nothing comes from a G-buffer.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from deferred_ir.base.arrays import Ints
from deferred_ir.frame.direct_lights import LIGHTS_PER_BLOCK
from deferred_ir.frame.facts import BLURRED_GLOSS, GLOSS
from deferred_ir.frame.frame import Frame, describe_environment
from deferred_ir.frame.light_culling import find_shining
from deferred_ir.frame.pass_io import Io
from deferred_ir.frame.uploads.mipmaps import MipmapParams
from deferred_ir.frame.vpl_buffer import VPLS_PER_BLOCK, find_spread
from deferred_ir.gl.shaders import Define
from deferred_ir.graph.facts import Facts
from deferred_ir.graph.params import param
from deferred_ir.graph.pass_base import Pass
from deferred_ir.graph.ports import Description, Input, Output, Texture
from deferred_ir.shadows import shader_variants
from deferred_ir.shadows.filter import ShadowFilter

FIRST_MAP = 1
"""Texture unit of the first depth map; unit 0 holds the primitives, FIRST_MAP + 1 a direct light's once more."""


@dataclass(frozen=True)
class Params(MipmapParams, ShadowFilter):
    """Parameters of the baseline."""

    lights_per_draw: int = param(1, lo=1, hi=8, doc="VPLs that one draw of the scene adds up.")


class Forward(Pass):
    """A draw of the scene for what emits, for each view of a direct light, for every `lights_per_draw` VPLs."""

    Params = Params
    inputs: ClassVar[Mapping[str, Input]] = {
        "lights": Input("the direct lights", format="light"),
        "vpls": Input("the VPLs", format="vpl"),
        "primitives": Input("face that shows, plus one", format="r32ui"),
        "depth": Input("depth of that face", format="depth32f", attach=True),
        "environment": Input("what shows behind everything", format="rgba32f", optional=True),
        "views": Input("how the direct lights' maps were drawn", format="view", optional=True),
        "light_maps": Input("the direct lights' maps", format="depth32f", optional=True),
        "blockers": Input("the same maps: what hides a part of a light's disc", format="depth32f", optional=True),
        "vpl_maps": Input("the VPLs' maps", format="depth32f", optional=True),
    }

    def outputs(self, inputs: Mapping[str, Description | None]) -> Mapping[str, Output]:
        """Radiance in 32 bits: a half float would lose the smaller of 256 terms."""
        del inputs
        return {"radiance": Output("radiance, linear RGB; alpha 0 on the background", Texture("rgba32f"))}

    def explain_shared_error(self, facts: Facts, inputs: Mapping[str, Description | None]) -> str | None:
        """Say what VPLs do to gloss."""
        del inputs
        return BLURRED_GLOSS if facts[GLOSS] else None

    def depends(self) -> frozenset[str]:
        """The camera and the models; the lights come as inputs."""
        return frozenset({"camera", "models"})

    def execute(self, frame: Frame, io: Io) -> None:
        """Draw the scene for each direct light and for each group of VPLs."""
        ctx = io.gpu.ctx
        io.framebuffer.clear_color()
        ctx.enable(ctx.DEPTH_TEST | ctx.BLEND)
        ctx.depth_func, ctx.blend_func = "==", (ctx.ONE, ctx.ONE)
        io.gpu.gl.DepthMask(0)
        defines = {
            "UNIT_MAPS": FIRST_MAP,
            "UNIT_BLOCKERS": FIRST_MAP + 1,
            "LIGHTS_PER_DRAW": self.params.lights_per_draw,
            **self.params.defines(),
            **frame.buffers.defines,
        }
        compare = io.gpu.sampler(linear=True, compare=">=")
        self._draw_emission(frame, io, defines)
        self._draw_lights(frame, io, defines, compare)
        self._draw_vpls(frame, io, defines, compare)

    def _draw_emission(self, frame: Frame, io: Io, defines: Mapping[str, Define]) -> None:
        """Draw what shines itself: surfaces, and what is behind them."""
        if frame.scene.shows_emission:
            program = io.program("forward_emission.frag", "scene.vert", defines=defines)
            frame.buffers.draw(program, mipmaps=self.params.mipmaps)
        if io["environment"]:
            program = io.program("background.frag")
            program.set(**describe_environment(frame.scene))
            io.gpu.ctx.disable(io.gpu.ctx.DEPTH_TEST)
            program.draw_fullscreen()
            io.gpu.ctx.enable(io.gpu.ctx.DEPTH_TEST)

    def _draw_lights(self, frame: Frame, io: Io, defines: Mapping[str, Define], compare: Any) -> None:
        lights, views, described = io["lights"], io["views"], frame.light_views
        variant = shader_variants.choose_for_lights(frame, lights.records, views.records if views else None)
        program = io.program("forward.frag", "scene.vert", defines={"DIRECT": 1, **defines, **variant})
        lit = find_shining(lights.records)
        for number in np.flatnonzero(lit).tolist():
            block, own = divmod(number, LIGHTS_PER_BLOCK)
            lights.bind(block)
            program.set(number=own)
            if views is None:
                frame.buffers.draw(program, mipmaps=self.params.mipmaps)
                continue
            views.bind(block)
            for view in np.flatnonzero(described.owners == number).tolist():
                io["light_maps"][view].bind(FIRST_MAP, compare)
                if io["blockers"]:
                    io["blockers"][view].bind(FIRST_MAP + 1, io.gpu.sampler(linear=False))
                program.set(view_number=int(described.rows[view]) % views.description.block)
                frame.buffers.draw(program, mipmaps=self.params.mipmaps)

    def _draw_vpls(self, frame: Frame, io: Io, defines: Mapping[str, Define], compare: Any) -> None:
        vpls, group = io["vpls"], self.params.lights_per_draw
        variant = shader_variants.choose_for_pixels(frame, vpls.records)
        program = io.program("forward.frag", "scene.vert", defines={"DIRECT": 0, "DISC": 0, **defines, **variant})
        for rows in _groups(vpls.records, group):
            for i, tile in enumerate(vpls.records["tile"][rows].astype(int) if io["vpl_maps"] else ()):
                io["vpl_maps"][tile].bind(FIRST_MAP + i, compare)
            vpls.bind(int(rows[0]) // VPLS_PER_BLOCK)
            numbers = np.resize(rows % VPLS_PER_BLOCK, group).tolist()
            program.set(numbers=numbers if group > 1 else numbers[0], count=len(rows))
            if frame.scene.has_gloss:
                program.set(vpl_spread=find_spread(vpls.records))
            frame.buffers.draw(program, mipmaps=self.params.mipmaps)


def _groups(vpls: np.ndarray, size: int) -> Iterator[Ints]:
    """Yield the rows of VPL records (n,) that each draw adds up: of one block, without dark VPLs."""
    lit = find_shining(vpls)
    for start in range(0, len(vpls), VPLS_PER_BLOCK):
        for first in range(start, min(start + VPLS_PER_BLOCK, len(vpls)), size):
            rows = np.arange(first, min(first + size, start + VPLS_PER_BLOCK, len(vpls)))
            if lit[rows].any():
                yield rows[lit[rows]]


PASS = Forward
