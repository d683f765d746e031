"""Find which neighbours a pixel may take light from: G-buffer -> the window's pixels that count, lonely pixels.

A window of n x n pixels has each share once wherever it lies. Its pixels count where they lie on the pixel's own
surface, which the G-buffer alone decides: where frames are reused, the pass is skipped while camera and models stand.
Where samples ask, these are the pixels here, and those of the list, which have no neighbours, are lonely.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import cos, radians, sin
from typing import ClassVar

from deferred_ir.frame.frame import Frame
from deferred_ir.frame.pass_io import Io
from deferred_ir.frame.vpl_params import explain_no_vpls
from deferred_ir.graph.facts import Facts
from deferred_ir.graph.params import param
from deferred_ir.graph.pass_base import Pass
from deferred_ir.graph.ports import Buffer, Description, Input, Output, Texture
from deferred_ir.pool.samples import ASKERS, check_askers, draw_askers
from deferred_ir.vpls.interleaving import SharesMeta, choose_window_side

IMAGES = ("lonely_pixels", "missing", "lonely_count")
"""Outputs that the shader stores into, in the order of their image units."""
TAPS = 16
"""Pixels of the window that a layer describes."""


@dataclass(frozen=True)
class Params:
    """Parameters of the choice of neighbours."""

    angle: float = param(
        25.0,
        lo=0.0,
        hi=180.0,
        doc="Neighbours count whose normals differ by less, and that lie half as much off the plane.",
        formerly="gather.angle",
    )
    fewest: float = param(
        0.5,
        lo=0.0,
        hi=1.0,
        doc="Where no larger part of the window counts, a pixel is lonely: it asks the missing VPLs itself.",
        formerly="gather.fewest",
    )


class Neighbours(Pass):
    """Which pixels near a pixel lie on its surface, and the pixels that have too few such neighbours."""

    Params = Params
    inputs: ClassVar[Mapping[str, Input]] = {
        "block": Input("edge of the blocks of pixels that the VPLs are dealt to", format="block"),
        **ASKERS,
    }

    def outputs(self, inputs: Mapping[str, Description | None]) -> Mapping[str, Output]:
        """Return bits for each pixel of the window, and a list with room for all pixels."""
        check_askers(inputs)
        block = inputs["block"]
        assert isinstance(block, Buffer)
        window = Texture("rg32ui", layers=-(-block.parts // TAPS))
        return {
            "window": Output("which neighbours count, 16 in a layer (shaders/lib/shares/window.glsl)", window),
            "lonely_pixels": Output("numbers of the pixels with too few neighbours", Texture("r32ui"), attach=False),
            "missing": Output("bits of the shares that each of them lacks", Texture("rg32ui"), attach=False),
            "lonely_count": Output("how many there are", Texture("r32ui", (1, 1)), attach=False),
        }

    def depends(self) -> frozenset[str]:
        """The camera, since positions are reconstructed from the depth; and the seed, which shifts the window."""
        return frozenset({"camera", "seed"})

    def unneeded(self, facts: Facts) -> str | None:
        """Leave the pass out where there are no VPLs."""
        return explain_no_vpls(facts)

    def execute(self, frame: Frame, io: Io) -> None:
        """Compare each pixel with its neighbours."""
        for unit, name in enumerate(IMAGES):
            io[name].bind_image(unit)
        io["lonely_count"].upload([[0]])
        angle = radians(self.params.angle)
        program = io.program("neighbours.frag", defines={"SMOOTH": int(frame.smooth)})
        program.set(
            cosine_squared=cos(angle) ** 2,
            sine_squared=sin(angle / 2) ** 2,
            fewest=self.params.fewest * io.meta("block", SharesMeta).n ** 2,
            side=choose_window_side(frame.seed),
        )
        draw_askers(io, program)
        io.gpu.barrier()


PASS = Neighbours
