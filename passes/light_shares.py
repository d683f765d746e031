"""Light each pixel by its share of the VPLs: vpls, G-buffer, shadows -> irradiance, in sub-buffers.

Pixels with the same share stand together in a sub-buffer (Segovia et al. 2006), so that each draw needs one list of
VPLs. The G-buffer is read with stride n instead of being copied. Where samples ask, their grid is lit as a small frame.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from deferred_ir.frame.frame import Frame
from deferred_ir.frame.light_culling import count_shining
from deferred_ir.frame.pass_io import Io
from deferred_ir.frame.vpl_params import explain_no_vpls
from deferred_ir.graph.facts import Facts
from deferred_ir.graph.pass_base import Pass
from deferred_ir.graph.ports import Description, Input, Output, Texture
from deferred_ir.pool.samples import ASKERS, check_askers, read_layout
from deferred_ir.shadows import shader_variants
from deferred_ir.shadows.filter import VplFilter
from deferred_ir.vpls.interleaving import SharesMeta, find_share_starts, find_sub_buffers


class LightShares(Pass):
    """Irradiance from each pixel's share of the VPLs, times n^2."""

    Params = VplFilter
    inputs: ClassVar[Mapping[str, Input]] = {
        "vpls": Input("the VPLs in the order of their shares", format="share"),
        **ASKERS,
        "near_field": Input("irradiance that clamped VPLs miss", format="rgba32f", optional=True),
        "rays": Input("which VPLs are seen, instead of maps", format="r32ui", optional=True),
        "shadows": Input("shadow atlas", format="depth32f", optional=True, linear=True, compare=">="),
    }

    def outputs(self, inputs: Mapping[str, Description | None]) -> Mapping[str, Output]:
        """Return one texture of the frame's size. It holds irradiance: the filter must not blur albedo."""
        check_askers(inputs)
        doc = "irradiance in sub-buffers; 0 on the background"
        # With the defines of the shadow filter: `gather` lights lonely pixels by the same one.
        return {"shares": Output(doc, Texture("rgba32f"), self.params.vpl_defines(), transient=True)}

    def depends(self) -> frozenset[str]:
        """The camera: positions are reconstructed from the depth."""
        return frozenset({"camera"})

    def unneeded(self, facts: Facts) -> str | None:
        """Leave the pass out where there are no VPLs."""
        return explain_no_vpls(facts)

    def execute(self, frame: Frame, io: Io) -> None:
        """Draw each share once for every block of the buffer that holds VPLs of it."""
        vpls, n = io["vpls"], io.meta("vpls", SharesMeta).n
        size = read_layout(io).grid if io["layout"] else frame.size
        ctx, block = io.gpu.ctx, vpls.description.block
        program = io.program("light_shares.frag", defines=shader_variants.choose_for_pixels(frame, vpls.records))
        ctx.blend_func = ctx.ONE, ctx.ONE
        if io["layout"]:
            program.set(grid=size)
        starts = find_share_starts(len(vpls.records), n).tolist()
        for share, rectangle in enumerate(find_sub_buffers(size, n)):
            io.gpu.gl.Viewport(*rectangle)
            start, stop = starts[share : share + 2]
            # An empty share is drawn as well, so that its pixels are 0.
            for number in range(start // block, max(stop - 1, start) // block + 1):
                vpls.bind(number)
                first, end = max(start, number * block), min(stop, (number + 1) * block)
                begins, count = first == start, count_shining(vpls.records[first:end])
                if not begins and not count:
                    continue
                first -= number * block
                if begins:  # the first draw of a share writes all of its pixels
                    ctx.disable(ctx.BLEND)
                else:
                    ctx.enable(ctx.BLEND)
                program.set(share=(share % n, share // n), begins=begins, first=first, end=first + count)
                if io["rays"]:
                    program.set(before=number * block - start)
                program.draw_fullscreen()


PASS = LightShares
