"""Filter the noise of reflections away, within the blur of each surface's lobe: reflections, G-buffer -> reflections.

An edge-avoiding a-trous filter (Dammertz et al. 2010) of 3 x 3 pixels, twice as far apart from step to step, which goes
on for as long as the lobe, seen from the camera, is wider than a part of what it blurs: a mirror stays sharp.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import cos, radians
from typing import ClassVar

from deferred_ir.frame.facts import explain_no_gloss
from deferred_ir.frame.frame import Frame
from deferred_ir.frame.pass_io import Io
from deferred_ir.graph.facts import Facts
from deferred_ir.graph.params import param
from deferred_ir.graph.pass_base import Pass
from deferred_ir.graph.ports import Description, Input, Output, Texture
from deferred_ir.pool.samples import read_layout
from deferred_ir.pool.traced_pixels import ALIKE


@dataclass(frozen=True)
class Params:
    """Parameters of the filter."""

    steps: int = param(4, lo=0, hi=8, doc="Passes; the last reaches 2^(steps - 1) pixels; 0: no filter.")
    reach: float = param(
        0.5, lo=0.0, hi=4.0, doc="How far light is blurred, as a part of the width to which the lobe blurs it itself."
    )
    angle: float = param(10.0, lo=0.0, hi=180.0, doc="Pixels count whose normals differ by less, degrees.")


class FilterReflections(Pass):
    """Filtered reflections."""

    Params = Params
    inputs: ClassVar[Mapping[str, Input]] = {
        "reflections": Input("reflected radiance over the share that is reflected, distance", format="rgba32f"),
        "layout": Input("where samples stand that traced for pixels around them", format="layout", optional=True),
        "blend": Input("what a pixel takes of which samples", format="r32ui", optional=True),
        "depth": Input("reversed depth", format="depth32f"),
        "normals": Input("shading and geometric normal", format="rgba16"),
        "material": Input("roughness, metallic and material", format="rgba16", optional=True),
    }

    def outputs(self, inputs: Mapping[str, Description | None]) -> Mapping[str, Output]:
        """Return two textures of the frame's size, between which the steps go back and forth."""
        del inputs
        doc = "reflected radiance over the share that is reflected; alpha: distance to what is reflected"
        return {
            "filtered": Output(doc, Texture("rgba32f"), attach=False, transient=True),
            "scratch": Output("the same, a step before", Texture("rgba32f"), attach=False, transient=True),
        }

    def unneeded(self, facts: Facts) -> str | None:
        """Leave the pass out where nothing is glossy or nothing shines."""
        return explain_no_gloss(facts)

    def explain_shared_error(self, facts: Facts, inputs: Mapping[str, Description | None]) -> str | None:
        """Say that reflections are filtered."""
        del facts, inputs
        return "the filter blurs reflections within their lobes" if self.params.steps else None

    def depends(self) -> frozenset[str]:
        """The camera, from which the lobes are seen."""
        return frozenset({"camera", "models"})

    def execute(self, frame: Frame, io: Io) -> None:
        """Filter step by step."""
        steps, unit = self.params.steps, int(io.defines["UNIT_REFLECTIONS"])
        draws = max(steps, 1)  # without steps the pixels are copied
        targets = [io["filtered"], io["scratch"]]
        program = io.program("filter_reflections.frag", defines={"SMOOTH": int(frame.smooth), "ALIKE": ALIKE})
        if io["layout"]:
            program.set(offset=read_layout(io).offset)
        for step in range(draws):
            target = targets[(draws - 1 - step) % 2]
            program.set(
                apart=1 << step if steps else 0, reach=self.params.reach, cosine=cos(radians(self.params.angle))
            )
            target.framebuffer.bind()
            program.draw_fullscreen()
            target.touch()
            target.bind(unit, io.gpu.sampler(False))


PASS = FilterReflections
