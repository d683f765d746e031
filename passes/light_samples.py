"""Add up what each sample's choices bring: choices, weights, what is seen, near field -> irradiance of samples."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from deferred_ir.frame.frame import Frame
from deferred_ir.frame.pass_io import Io
from deferred_ir.frame.vpl_params import explain_no_vpls
from deferred_ir.graph.facts import Facts
from deferred_ir.graph.pass_base import Pass
from deferred_ir.graph.ports import Description, Input, Output, Texture
from deferred_ir.graph.stages import Stage, stage_param
from deferred_ir.pool.samples import draw_samples, read_layout


@dataclass(frozen=True)
class Params:
    """How it runs."""

    stage: Stage = stage_param()


class LightSamples(Pass):
    """Irradiance of samples, not filtered: right in the mean over seeds."""

    Params = Params
    inputs: ClassVar[Mapping[str, Input]] = {
        "layout": Input("where samples stand", format="layout"),
        "vpls": Input("the pool: its cone", format="vpl"),
        "positions": Input("where samples are", format="rgba32f"),
        "sample_normals": Input("their normals", format="rgba16"),
        "list_positions": Input("VPLs for each tile: position, power times weight", format="rgba32f"),
        "list_normals": Input("normal, clamp^2", format="rgba32f"),
        "list_emissions": Input("emission times weight", format="rgba32f"),
        "choices": Input("places in the lists", format="rgba32ui"),
        "weights": Input("by which each choice stands for others", format="rgba32f"),
        "seen": Input("bits of the choices that are seen", format="r32ui"),
        "near_field": Input("irradiance that clamped VPLs miss", format="rgba32f", optional=True),
    }

    def outputs(self, inputs: Mapping[str, Description | None]) -> Mapping[str, Output]:
        """Return one texture of the frame's size."""
        del inputs
        return {
            "irradiance": Output("irradiance from the VPLs at samples", Texture("rgba32f"), image=True, transient=True)
        }

    def depends(self) -> frozenset[str]:
        """Nothing of the frame."""
        return frozenset()

    def unneeded(self, facts: Facts) -> str | None:
        """Leave the pass out where there are no VPLs."""
        return explain_no_vpls(facts)

    def execute(self, frame: Frame, io: Io) -> None:
        """Add up for all samples."""
        program = io.stage_program("light_samples/light", {"SMOOTH": int(frame.smooth)})
        draw_samples(io, program, read_layout(io))


PASS = LightSamples
