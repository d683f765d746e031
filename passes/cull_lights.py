"""Find which VPLs may light which tiles of the screen (tiled light culling): vpls, depth -> tiles, a bit for each pair.

The surfaces in a tile lie in a frustum between its smallest and its largest depth. A VPL adds exactly nothing to a tile
whose frustum lies behind it, or outside the pyramid about its cone.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from deferred_ir.frame.facts import SOFTWARE
from deferred_ir.frame.frame import Frame
from deferred_ir.frame.light_culling import MARGIN
from deferred_ir.frame.pass_io import Io
from deferred_ir.frame.screen_tiles import describe_output, find_block
from deferred_ir.frame.vpl_buffer import VPLS_PER_BLOCK
from deferred_ir.frame.vpl_params import explain_no_vpls
from deferred_ir.graph.facts import Facts
from deferred_ir.graph.pass_base import Pass
from deferred_ir.graph.ports import Buffer, Description, Input, Output


class CullLights(Pass):
    """Bits of the VPLs that may light each tile of the screen."""

    inputs: ClassVar[Mapping[str, Input]] = {
        "vpls": Input("the VPLs", format="vpl"),
        "depth": Input("reversed depth", format="depth32f"),
    }

    def outputs(self, inputs: Mapping[str, Description | None]) -> Mapping[str, Output]:
        """Return one texture, with a texel for each tile and group of VPLs."""
        vpls = inputs["vpls"]
        assert isinstance(vpls, Buffer)
        return {"tiles": describe_output(vpls.records)}

    def depends(self) -> frozenset[str]:
        """The camera and, through the near plane, the scene."""
        return frozenset({"camera", "models"})

    def unneeded(self, facts: Facts) -> str | None:
        """Leave the pass out where there are no VPLs, and on a GPU, where nobody has measured what it brings."""
        return explain_no_vpls(facts) or (None if facts[SOFTWARE] else "it is for OpenGL in software")

    def execute(self, frame: Frame, io: Io) -> None:
        """Draw the texels of each block of VPLs."""
        vpls, count = io["vpls"], len(io["vpls"].records)
        io.framebuffer.clear_color()
        program = io.program("cull_lights.frag")
        program.set(margin=MARGIN, reach=max(map(abs, frame.scene.camera.position)))
        for block, first in enumerate(range(0, count, VPLS_PER_BLOCK)):
            vpls.bind(block)
            io.gpu.gl.Viewport(*find_block(block))
            program.set(count=min(VPLS_PER_BLOCK, count - first))
            program.draw_fullscreen()


PASS = CullLights
