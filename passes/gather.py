"""Filter the pattern of interleaving away inside surfaces: shares, window, lonely pixels -> irradiance.

The mean over the pixels of the window on the pixel's own surface (passes/neighbours.py) is what all VPLs give there
(Laine et al. 2007, section 5.2). Lonely pixels, on thin things, ask the VPLs of the shares that they miss: they are
packed into rows of a second draw, so that no processor idles beside them.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from deferred_ir.base.arrays import Ints
from deferred_ir.frame.frame import Frame
from deferred_ir.frame.light_culling import count_shining
from deferred_ir.frame.pass_io import Io
from deferred_ir.graph.facts import Facts
from deferred_ir.graph.pass_base import Pass
from deferred_ir.graph.ports import Description, Input, Output, Texture
from deferred_ir.pool.samples import ASKERS, check_askers, draw_askers, read_layout
from deferred_ir.shadows import shader_variants
from deferred_ir.vpls.interleaving import SharesMeta, choose_window_side, find_share_starts


class Gather(Pass):
    """A box filter that stops at edges."""

    inputs: ClassVar[Mapping[str, Input]] = {
        "vpls": Input("the VPLs in the order of their shares", format="share"),
        "shares": Input("irradiance in sub-buffers", format="rgba32f"),
        "window": Input("which neighbours count", format="rg32ui"),
        "lonely_pixels": Input("numbers of the pixels with too few neighbours", format="r32ui"),
        "missing": Input("bits of the shares that each of them lacks", format="rg32ui"),
        "lonely_count": Input("how many there are", format="r32ui"),
        **ASKERS,
        "near_field": Input("irradiance that clamped VPLs miss", format="rgba32f", optional=True),
        "rays": Input(
            "which VPLs are seen: then they have no maps, and lonely pixels are left", "r32ui", optional=True
        ),
        "shadows": Input("shadow atlas", format="depth32f", optional=True, linear=True, compare=">="),
    }

    def outputs(self, inputs: Mapping[str, Description | None]) -> Mapping[str, Output]:
        """Return one texture of the frame's size."""
        check_askers(inputs)
        return {"irradiance": Output("irradiance from the VPLs", Texture("rgba32f"), transient=True)}

    def depends(self) -> frozenset[str]:
        """The camera, to reconstruct lonely pixels' positions from the depth; and the seed, which shifts the window."""
        return frozenset({"camera", "seed"})

    def explain_shared_error(self, facts: Facts, inputs: Mapping[str, Description | None]) -> str | None:
        """Say that light is filtered."""
        del facts, inputs
        return "the filter blurs the light of single VPLs"

    def execute(self, frame: Frame, io: Io) -> None:
        """Filter, then light the lonely pixels."""
        gpu, vpls = io.gpu, io["vpls"]
        program = io.program("gather.frag")
        program.set(side=choose_window_side(frame.seed))
        draw_askers(io, program)
        if io["rays"]:
            return
        defines = shader_variants.choose_for_pixels(frame, vpls.records)
        program = io.program("lonely_pixels/light.frag", "lonely_pixels/rows.vert", defines=defines)
        if io["layout"] and len(vpls.records):
            program.set(grid=read_layout(io).grid)
        io["irradiance"].bind_image(0)
        gpu.clip(1)  # to the rows that the list fills
        gpu.gl.ColorMask(0, 0, 0, 0)  # the shader stores where each pixel belongs
        shares = io.meta("vpls", SharesMeta).n ** 2
        block = vpls.description.block
        for start in range(0, len(vpls.records), block):
            ranges = _find_ranges(vpls.records, shares, start, start + block)
            if not ranges.any():
                continue
            gpu.barrier()
            vpls.bind(start // block)
            program.set(ranges=ranges.tolist())
            program.draw_fullscreen()
        gpu.barrier()


def _find_ranges(vpls: np.ndarray, shares: int, start: int, stop: int) -> Ints:
    """Return where each share begins and ends in the block of VPLs `start` to `stop` (VPL records), int (s, 2)."""
    starts = np.clip(find_share_starts(len(vpls), round(shares**0.5)), start, stop)
    ends = [first + count_shining(vpls[first:end]) for first, end in itertools.pairwise(starts)]
    ranges: Ints = np.column_stack([starts[:-1], ends]) - start
    return np.where((ranges[:, 1] > ranges[:, 0])[:, None], ranges, 0)


PASS = Gather
