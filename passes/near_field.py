"""Restore by short rays the light that the clamp takes (Kollig and Keller 2004): vpls, G-buffer -> residual.

The G-buffer is read back, Embree traces on the CPU, and the residual goes up as a texture, to be filtered with the
light of the VPLs that it completes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from deferred_ir.base.errors import GraphError
from deferred_ir.frame.facts import EMITS
from deferred_ir.frame.frame import Frame
from deferred_ir.frame.pass_io import Io
from deferred_ir.frame.vpl_buffer import VplsMeta, read_limits
from deferred_ir.frame.vpl_params import CLAMP_RETURNED, CLAMPED
from deferred_ir.graph.facts import Facts, Statements
from deferred_ir.graph.params import param
from deferred_ir.graph.pass_base import Pass
from deferred_ir.graph.ports import Description, Input, Output, Texture
from deferred_ir.pool.effort import accept_effort, read_effort
from deferred_ir.rays.pixel_surfaces import PixelJob
from deferred_ir.vpls.clamp_residual import trace_residual
from deferred_ir.vpls.interleaving import SharesMeta

BLOCK = 4
"""Edge of the blocks of samples that the rays' pattern shares: about the reach of the filter that follows."""


@dataclass(frozen=True)
class Params:
    """Parameters of the near field."""

    samples: float = param(
        4.0, lo=0.25, hi=16.0, doc="Rays a pixel; below 1 the share of pixels that trace one, above 1 a whole number."
    )


class NearField(Pass):
    """Irradiance that clamped VPLs miss, unfiltered."""

    Params = Params
    inputs: ClassVar[Mapping[str, Input]] = {
        "vpls": Input("the VPLs: their clamp and cone", format="vpl"),
        "dealt": Input("the VPLs as dealt to pixels, whose blocks the rays' pattern shares", "share", optional=True),
        "depth": Input("reversed depth; or else `positions`", format="depth32f", optional=True),
        "positions": Input("where samples are, if these ask and not all pixels", format="rgba32f", optional=True),
        "normals": Input("shading and geometric normal, of pixels or of samples", format="rgba16"),
        "effort": accept_effort("factor on `samples`"),
    }

    def outputs(self, inputs: Mapping[str, Description | None]) -> Mapping[str, Output]:
        """Return one texture of the frame's size. Raises GraphError unless pixels or samples ask, one of them."""
        if (inputs["depth"] is None) == (inputs["positions"] is None):
            raise GraphError("connect either depth, for all pixels, or positions, for samples")
        doc = "irradiance lost to the clamp; alpha: the pixel's weight, 0 where no ray was traced"
        return {"residual": Output(doc, Texture("rgba32f"), transient=True)}

    def state_facts(self, facts: Facts) -> Statements:
        """State that the light that the clamp takes is restored."""
        del facts
        return {CLAMP_RETURNED: True}

    def unneeded(self, facts: Facts) -> str | None:
        """Leave the pass out where nothing is clamped or the light is off."""
        if not facts[EMITS]:
            return "nothing shines"
        return None if facts[CLAMPED] else "nothing is clamped: vpl.clamp or vpl.count is 0"

    def depends(self) -> frozenset[str]:
        """What the camera sees, and how the light falls on it."""
        return frozenset({"camera", "light", "models", "seed"})

    def execute(self, frame: Frame, io: Io) -> None:
        """Read the G-buffer back, trace, upload."""
        vpls = io["vpls"].records
        if len(vpls) == 0:
            io.framebuffer.clear_color()
            return
        block = io.meta("dealt", SharesMeta).n if io["dealt"] else BLOCK if io["positions"] else 1
        if io["positions"]:
            seen = frame.read_samples(io["positions"], io["normals"])
        else:
            seen = frame.read_surfaces(io["depth"], io["normals"])
        job = PixelJob(frame.tracer(), seen, frame.size, block, frame.seed)
        bounces = io.meta("vpls", VplsMeta).bounces
        samples = self.params.samples * read_effort(io.step.descriptions)
        image = trace_residual(job, read_limits(vpls), samples=samples, bounces=bounces)
        io["residual"].upload(image)


PASS = NearField
