"""Put sub-buffers together and filter the pattern away inside surfaces: shares, G-buffer, lights -> irradiance.

A window of n x n pixels has each share once wherever it lies; the mean over the neighbours on the pixel's own surface
is what all VPLs give there (Laine et al. 2007, section 5.2). Where too few count, on thin things, the pixel itself asks
the VPLs of the shares that are missing: such pixels are packed into rows of a second draw, so that no processor idles
beside them. Which neighbours count follows from the G-buffer alone: where frames are reused it is kept with it.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass
from math import cos, radians, sin
from typing import Any, ClassVar

import numpy as np

from deferred_ir.base.arrays import Ints
from deferred_ir.frame.frame import Frame
from deferred_ir.frame.light_culling import count_shining
from deferred_ir.frame.pass_io import Io
from deferred_ir.graph.params import param
from deferred_ir.graph.pass_base import Pass
from deferred_ir.graph.ports import Description, Input, Output, Texture
from deferred_ir.shadows import shader_variants
from deferred_ir.vpls.interleaving import SharesMeta, find_share_starts

IRRADIANCE, THIN, COUNT, MISSING = range(4)
"""Image units that the shaders declare."""


@dataclass(frozen=True)
class Params:
    """Parameters of the filter."""

    angle: float = param(
        25.0,
        lo=0.0,
        hi=180.0,
        doc="Neighbours count whose normals differ by less, and that lie half as much off the plane.",
    )
    fewest: float = param(
        0.5, lo=0.0, hi=1.0, doc="Where no larger part of the window counts, a pixel asks the missing VPLs itself."
    )


@dataclass
class State:
    """From what the neighbours that count were found, None if that is not known."""

    windows: tuple[Any, ...] | None = None


class Gather(Pass):
    """A box filter that stops at edges."""

    Params = Params
    State = State
    inputs: ClassVar[Mapping[str, Input]] = {
        "vpls": Input("the VPLs in the order of their shares", format="share"),
        "shares": Input("irradiance in sub-buffers", format="rgba32f"),
        "depth": Input("reversed depth", format="depth32f"),
        "normals": Input("shading and geometric normal", format="rgba16"),
        "near_field": Input("irradiance that clamped VPLs miss", format="rgba32f", optional=True),
        "rays": Input("which VPLs are seen: then they have no maps, and thin things are left", "r32ui", optional=True),
        "shadows": Input("shadow atlas", format="depth32f", optional=True, linear=True, compare=">="),
    }

    def outputs(self, inputs: Mapping[str, Description | None]) -> Mapping[str, Output]:
        """Irradiance of the frame's size, and the pixels that the window is not enough for."""
        del inputs
        return {
            "irradiance": Output("irradiance from the VPLs", Texture("rgba32f"), transient=True),
            "thin": Output("pixels that ask VPLs themselves, row by row", Texture("r32ui"), attach=False),
            "missing": Output("of which shares, 64 bits a pixel", Texture("rg32ui"), attach=False),
            "count": Output("how many", Texture("r32ui", (1, 1)), attach=False),
        }

    def depends(self) -> frozenset[str]:
        """Positions come back from the depth; the window leans to a side by the seed."""
        return frozenset({"camera", "seed"})

    def execute(self, frame: Frame, io: Io) -> None:
        """Filter, then light the pixels that it left."""
        gpu, vpls = io.gpu, io["vpls"]
        for unit, name in ((IRRADIANCE, "irradiance"), (THIN, "thin"), (COUNT, "count"), (MISSING, "missing")):
            io[name].bind_image(unit)
        io["count"].upload([[0]])
        angle, shares = radians(self.params.angle), io.meta("vpls", SharesMeta).n ** 2
        # An even window is off centre: in frames with fresh seeds to all sides, so that their mean is not.
        side = frame.seed & 1, frame.seed >> 1 & 1
        drawn = io["depth"].version, io["normals"].version
        windows = (*drawn, shares, self.params, side) if frame.reuse else None
        known = windows is not None and io.state.windows == windows
        defines = shader_variants.choose_for_pixels(frame, vpls.records)
        kept = {"SMOOTH": defines["SMOOTH"], "KEEP": int(frame.reuse), "KNOWN": int(known)}
        program = io.program("gather.frag", defines=kept)
        program.set(
            cosine_squared=cos(angle) ** 2,
            sine_squared=sin(angle / 2) ** 2,
            fewest=self.params.fewest * shares,
            side=side,
        )
        io.state.windows = None
        program.draw_fullscreen()
        io.state.windows = windows
        if io["rays"]:
            gpu.barrier()
            return
        program = io.program("lonely_pixels/light.frag", "lonely_pixels/rows.vert", defines=defines)
        gpu.clip(1)  # to the rows that the list fills
        gpu.gl.ColorMask(0, 0, 0, 0)  # the shader stores where each pixel belongs
        block = vpls.description.block
        for start in range(0, len(vpls.records), block):
            ranges = _ranges(vpls.records, shares, start, start + block)
            if not ranges.any():
                continue
            gpu.barrier()
            vpls.bind(start // block)
            program.set(ranges=ranges.tolist())
            program.draw_fullscreen()
        gpu.barrier()


def _ranges(vpls: np.ndarray, shares: int, start: int, stop: int) -> Ints:
    """Where in the block from `start` to `stop` of VPLs, VPL records (n,), each share begins and ends, int (s, 2)."""
    starts = np.clip(find_share_starts(len(vpls), round(shares**0.5)), start, stop)
    ends = [first + count_shining(vpls[first:end]) for first, end in itertools.pairwise(starts)]
    ranges: Ints = np.column_stack([starts[:-1], ends]) - start
    return np.where((ranges[:, 1] > ranges[:, 0])[:, None], ranges, 0)


PASS = Gather
