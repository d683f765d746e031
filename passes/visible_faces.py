"""Find the face that shows in each pixel, for the baseline: -> primitives, depth."""

from __future__ import annotations

from collections.abc import Mapping

from deferred_ir.frame.frame import Frame
from deferred_ir.frame.pass_io import Io
from deferred_ir.graph.pass_base import Pass
from deferred_ir.graph.ports import Description, Output, Texture


class VisibleFaces(Pass):
    """Depth and face number of the nearest surface."""

    def outputs(self, inputs: Mapping[str, Description | None]) -> Mapping[str, Output]:
        """Return two textures of the frame's size."""
        del inputs
        return {
            "primitives": Output("number of the face, plus one; 0 is the background", Texture("r32ui")),
            "depth": Output("reversed depth, near/z; 0 is the background", Texture("depth32f")),
        }

    def depends(self) -> frozenset[str]:
        """The camera and the models."""
        return frozenset({"camera", "models"})

    def execute(self, frame: Frame, io: Io) -> None:
        """Draw all triangles."""
        io.framebuffer.clear_color()
        io.framebuffer.clear_depth()
        ctx = io.gpu.ctx
        ctx.enable(ctx.DEPTH_TEST)
        ctx.depth_func = ">"
        # The vertex shader of the passes that test depth for equality, with all its outputs, of which one is read.
        frame.buffers.draw(io.program("visible_faces.frag", "scene.vert", defines=frame.buffers.defines))


PASS = VisibleFaces
