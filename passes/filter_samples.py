"""Filter the noise of samples away inside surfaces: irradiance, samples -> irradiance.

An edge-avoiding a-trous wavelet filter (Dammertz et al. 2010) whose reach goes by an estimate of the noise's variance
(Schied et al. 2017). A first box of 3 x 3 samples gives mean and variance. Further steps are 3 x 3 samples, twice as
far apart from step to step, and take the less of a sample, the more standard deviations its light differs.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import cos, radians
from typing import ClassVar

from deferred_ir.frame.frame import Frame
from deferred_ir.frame.pass_io import Io
from deferred_ir.frame.vpl_params import explain_no_vpls
from deferred_ir.graph.facts import Facts
from deferred_ir.graph.params import param
from deferred_ir.graph.pass_base import Pass
from deferred_ir.graph.ports import Description, Input, Output, Texture
from deferred_ir.graph.stages import Stage, stage_param
from deferred_ir.pool.samples import draw_samples, read_layout


@dataclass(frozen=True)
class Params:
    """Parameters of the filter."""

    steps: int = param(
        3, lo=0, hi=8, doc="Passes over the samples; the last reaches 2^(steps - 1) samples; 0: no filter."
    )
    tolerance: float = param(
        4.0, lo=0.0, hi=1e6, doc="Standard deviations by which the light of one surface may differ."
    )
    angle: float = param(15.0, lo=0.0, hi=180.0, doc="Samples count whose normals differ by less, degrees.")
    slack: float = param(0.3, lo=0.0, hi=16.0, doc="And that lie no farther off the plane, in steps between samples.")
    stage: Stage = stage_param()


class FilterSamples(Pass):
    """Filtered irradiance of the grid's samples. Those of the list get the mean of the nearest of them."""

    Params = Params
    inputs: ClassVar[Mapping[str, Input]] = {
        "layout": Input("where samples stand", format="layout"),
        "irradiance": Input("irradiance of samples", format="rgba32f"),
        "positions": Input("where samples are", format="rgba32f"),
        "sample_normals": Input("their normals", format="rgba16"),
        "pixels": Input("their pixels", format="r32ui"),
        "blend": Input("which pixels are samples of the list, and where", format="r32ui"),
    }

    def outputs(self, inputs: Mapping[str, Description | None]) -> Mapping[str, Output]:
        """Return two textures of the frame's size, between which the steps go back and forth."""
        del inputs
        return {
            "filtered": Output(
                "irradiance; alpha: standard deviation of its luminance",
                Texture("rgba32f"),
                attach=False,
                image=True,
                transient=True,
            ),
            "scratch": Output("the same, a step before", Texture("rgba32f"), attach=False, image=True, transient=True),
        }

    def depends(self) -> frozenset[str]:
        """The camera, for the distance between samples; and the seed, which places the grid."""
        return frozenset({"camera", "seed"})

    def unneeded(self, facts: Facts) -> str | None:
        """Leave the pass out where there are no VPLs."""
        return explain_no_vpls(facts)

    def explain_shared_error(self, facts: Facts, inputs: Mapping[str, Description | None]) -> str | None:
        """Say that light is filtered."""
        del facts, inputs
        return "the filter blurs light inside surfaces" if self.params.steps else None

    def execute(self, frame: Frame, io: Io) -> None:
        """Filter step by step."""
        steps, unit, image = self.params.steps, int(io.defines["UNIT_IRRADIANCE"]), int(io.defines["IMAGE_FILTERED"])
        draws = max(steps, 1)  # without steps the samples are copied
        layout = read_layout(io)
        targets = [io["filtered"], io["scratch"]]
        for step in range(draws):
            target = targets[(draws - 1 - step) % 2]
            defines = {"FIRST": int(step == 0), "SMOOTH": int(frame.smooth)}
            program = io.stage_program("filter_samples/filter", defines)
            program.set(
                grid=layout.grid,
                apart=1 << step if steps else 0,
                tolerance=self.params.tolerance,
                cosine=cos(radians(self.params.angle)),
                slack=self.params.slack * layout.scale,
            )
            if program.computes:
                io.gpu.barrier()  # after the step before
                target.bind_image(image)
            else:
                target.framebuffer.bind()
            draw_samples(io, program, layout)
            target.touch()
            target.bind(unit, io.gpu.sampler(False))


PASS = FilterSamples
