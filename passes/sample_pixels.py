"""Choose the pixels that ask for indirect light: G-buffer -> the samples' surfaces, and how pixels blend them.

Samples are a grid of every second pixel, say, in both directions. A pixel that lies on the surface of no sample around
it becomes a sample of its own, so that no light crosses an edge.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import cos, radians
from typing import ClassVar

import numpy as np

from deferred_ir.frame.frame import Frame
from deferred_ir.frame.pass_io import Io
from deferred_ir.frame.vpl_params import explain_no_vpls
from deferred_ir.graph.facts import Facts
from deferred_ir.graph.figures import Figure
from deferred_ir.graph.params import param
from deferred_ir.graph.pass_base import Pass
from deferred_ir.graph.ports import Description, Input, Output, Texture
from deferred_ir.pool.effort import accept_effort, read_effort
from deferred_ir.pool.layout import LONELY, Layout
from deferred_ir.pool.samples import describe_layout, draw_samples, write_layout

SAMPLES = Figure("samples", "Pixels that ask for indirect light.", ("samples",))


@dataclass(frozen=True)
class Params:
    """Parameters of the choice of samples."""

    scale: int = param(2, lo=1, hi=8, doc="Pixels from sample to sample; 1: every pixel asks.")
    angle: float = param(
        25.0, lo=0.0, hi=180.0, doc="A sample stands for pixels whose normals differ by less, degrees."
    )
    slack: float = param(
        0.5, lo=0.0, hi=16.0, doc="And that lie no farther off its plane, in steps of the grid at their distance."
    )


class SamplePixels(Pass):
    """The samples of a frame."""

    Params = Params
    figures = (SAMPLES,)
    inputs: ClassVar[Mapping[str, Input]] = {
        "depth": Input("reversed depth", format="depth32f"),
        "normals": Input("shading and geometric normal", format="rgba16"),
        "effort": accept_effort("by which `scale` is divided"),
    }

    def outputs(self, inputs: Mapping[str, Description | None]) -> Mapping[str, Output]:
        """Return textures of the frame's size, which have room for all pixels."""
        scale = self._divide_scale(inputs)
        defines = {"SCALE": scale}
        where = "position, and depth of view; 0 where there is no sample or nothing was seen"
        weights = "what the pixel takes of the four samples around it, or the texel of its own sample"
        return {
            "layout": describe_layout(),
            "positions": Output(where, Texture("rgba32f")),
            "sample_normals": Output("shading and geometric normal of samples", Texture("rgba16")),
            "pixels": Output("number of the pixel of each sample", Texture("r32ui"), attach=False),
            "blend": Output(weights, Texture("r32ui"), defines, attach=False),
        }

    def depends(self) -> frozenset[str]:
        """The camera, since positions are reconstructed from the depth; and the seed, which moves the grid."""
        return frozenset({"camera", "models", "seed"})

    def unneeded(self, facts: Facts) -> str | None:
        """Leave the pass out where there are no VPLs."""
        return explain_no_vpls(facts)

    def explain_shared_error(self, facts: Facts, inputs: Mapping[str, Description | None]) -> str | None:
        """Return how far samples are apart."""
        del facts
        scale = self._divide_scale(inputs)
        return f"light is blended from samples {scale} pixels apart" if scale > 1 else None

    def _divide_scale(self, inputs: Mapping[str, Description | None]) -> int:
        scale: int = self.params.scale
        return max(scale // read_effort(inputs), 1)

    def execute(self, frame: Frame, io: Io) -> None:
        """Find lonely pixels, then gather the samples' surfaces."""
        scale = self._divide_scale(io.step.descriptions)
        layout = Layout.of_frame(frame.size, scale, frame.seed)
        defines = {"SMOOTH": int(frame.smooth)}
        listed = np.zeros(0, int)
        if scale > 1:
            blend = self._draw_blend(layout, io, defines)
            listed = np.flatnonzero(blend == LONELY)
            layout = replace(layout, listed=len(listed))
            if len(listed):  # lonely pixels are told which texels their samples have
                blend.reshape(-1)[listed] |= layout.find_list_places().astype(np.uint32)
                io["blend"].upload(blend)
        write_layout(io, layout)
        io["pixels"].upload(layout.place(listed)[..., None])
        io["pixels"].bind_image(0)
        io.framebuffer.bind()
        for target in range(2):
            io.framebuffer.clear_color(target)
        draw_samples(io, io.program("sample_pixels/surfaces.frag", defines=defines), layout)
        columns, rows = layout.grid
        io.report(SAMPLES.name, columns * rows + len(listed))

    def _draw_blend(self, layout: Layout, io: Io, defines: Mapping[str, int | float]) -> np.ndarray:
        """Draw `blend` and read it back, uint32 (H, W, 1)."""
        io["blend"].framebuffer.bind()
        program = io.program("sample_pixels/blend.frag", defines=defines)
        cosine = cos(radians(self.params.angle))
        program.set(offset=layout.offset, cosine=cosine, slack=self.params.slack)
        program.draw_fullscreen()
        io["blend"].touch()
        blend: np.ndarray = io["blend"].read()
        return blend


PASS = SamplePixels
