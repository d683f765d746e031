"""The assignment's way, kept as the baseline: the scene is drawn for each light and added up by blending.

lights, depth and primitives of visible_faces, a plain depth map for each light -> radiance. Positions are interpolated
from the vertices; nothing comes from a G-buffer.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from deferred_ir.base.arrays import Ints
from deferred_ir.frame.frame import Frame
from deferred_ir.frame.light_culling import in_order, shining
from deferred_ir.frame.pass_io import Io
from deferred_ir.graph.params import param
from deferred_ir.graph.pass_base import Pass
from deferred_ir.graph.ports import Description, Input, Output, Texture
from deferred_ir.scene.lights.spot import LIGHTS_PER_BLOCK
from deferred_ir.shadows import shader_variants

FIRST_MAP = 1
"""Texture unit of the first depth map; unit 0 holds the primitives, FIRST_MAP + 1 the spotlight's once more."""


@dataclass(frozen=True)
class Params:
    """Parameters of the baseline."""

    lights_per_draw: int = param(1, lo=1, hi=8, doc="VPLs that one draw of the scene adds up.")


class Forward(Pass):
    """Reflected radiance, one draw of the scene for the spotlight and one for every `lights_per_draw` VPLs."""

    Params = Params
    inputs: ClassVar[Mapping[str, Input]] = {
        "lights": Input("the spotlight, then the VPLs", format="light"),
        "primitives": Input("face that shows, plus one", format="r32ui"),
        "depth": Input("depth of that face", format="depth32f", attach=True),
        "spot": Input("the spotlight's map", format="depth32f", optional=True),
        "blockers": Input("the same: what hides a part of its disc", format="depth32f", optional=True),
        "vpls": Input("the VPLs' maps", format="depth32f", optional=True),
    }

    def outputs(self, inputs: Mapping[str, Description | None]) -> Mapping[str, Output]:
        """Radiance in 32 bits: 256 terms drown in a half float."""
        del inputs
        return {"radiance": Output("reflected radiance, linear RGB; 0 on the background", Texture("rgba32f"))}

    def depends(self) -> frozenset[str]:
        """The scene is drawn from the camera."""
        return frozenset({"camera", "models"})

    def execute(self, frame: Frame, io: Io) -> None:
        """Draw the scene for each group of lights."""
        ctx, lights, group = io.gpu.ctx, io["lights"], self.params.lights_per_draw
        io.framebuffer.clear_color()
        ctx.enable(ctx.DEPTH_TEST | ctx.BLEND)
        ctx.depth_func, ctx.blend_func = "==", (ctx.ONE, ctx.ONE)
        io.gpu.gl.DepthMask(0)
        defines = {
            "UNIT_MAPS": FIRST_MAP,
            "UNIT_BLOCKERS": FIRST_MAP + 1,
            "LIGHTS_PER_DRAW": group,
            **frame.buffers.defines,
        }
        compare = io.gpu.sampler(linear=True, compare=">=")
        lights.bind_uniform(1, 0)
        if io["spot"]:
            io["spot"][0].bind(FIRST_MAP, compare)
        if io["blockers"]:
            io["blockers"][0].bind(FIRST_MAP + 1, io.gpu.sampler(linear=False))
        direct = {"DIRECT": 1, **defines, **shader_variants.of_spotlight(frame, lights.records)}
        frame.buffers.draw(io.program("forward.frag", "scene.vert", defines=direct))
        indirect = {"DIRECT": 0, "DISC": 0, **defines, **shader_variants.of_pixels(frame, lights.records[1:])}
        program = io.program("forward.frag", "scene.vert", defines=indirect)
        for rows in _groups(lights.records, group):
            for i, tile in enumerate(lights.records["tile"][rows].astype(int) if io["vpls"] else ()):
                io["vpls"][tile].bind(FIRST_MAP + i, compare)
            lights.bind_uniform(1, int(rows[0]) // LIGHTS_PER_BLOCK)
            numbers = np.resize(rows % LIGHTS_PER_BLOCK, group).tolist()
            program.set(numbers=numbers if group > 1 else numbers[0], count=len(rows))
            frame.buffers.draw(program)


def _groups(records: np.ndarray, size: int) -> Iterator[Ints]:
    """Rows of the VPLs with power that each draw adds up, of LIGHT records (n,). No draw's are of two blocks."""
    order, lit, number = in_order(records), shining(records), 1
    while number < len(records):
        count = min(size, LIGHTS_PER_BLOCK - number % LIGHTS_PER_BLOCK)
        rows = order[number : number + count]
        if lit[rows].any():
            yield rows[lit[rows]]
        number += count


PASS = Forward
