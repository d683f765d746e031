"""Blend the light of samples for all pixels, within surfaces: samples' irradiance -> irradiance."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from deferred_ir.frame.frame import Frame
from deferred_ir.frame.pass_io import Io
from deferred_ir.frame.vpl_params import explain_no_vpls
from deferred_ir.graph.facts import Facts
from deferred_ir.graph.pass_base import Pass
from deferred_ir.graph.ports import Description, Input, Output, Texture
from deferred_ir.pool.samples import read_layout


class BlendSamples(Pass):
    """Joint bilateral upsampling (Kopf et al. 2007) by the weights that the choice of samples has found."""

    inputs: ClassVar[Mapping[str, Input]] = {
        "layout": Input("where samples stand", format="layout"),
        "light": Input("irradiance of samples", format="rgba32f"),
        "blend": Input("what a pixel takes of which samples", format="r32ui"),
    }

    def outputs(self, inputs: Mapping[str, Description | None]) -> Mapping[str, Output]:
        """Return one texture of the frame's size."""
        del inputs
        return {"irradiance": Output("irradiance from the VPLs", Texture("rgba32f"), transient=True)}

    def depends(self) -> frozenset[str]:
        """The seed, which places the grid."""
        return frozenset({"seed"})

    def unneeded(self, facts: Facts) -> str | None:
        """Leave the pass out where there are no VPLs."""
        return explain_no_vpls(facts)

    def execute(self, frame: Frame, io: Io) -> None:
        """Draw all pixels."""
        program = io.program("blend_samples.frag")
        program.set(offset=read_layout(io).offset)
        program.draw_fullscreen()


PASS = BlendSamples
