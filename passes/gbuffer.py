"""Draw the scene once into the textures that lighting reads: -> normals, albedo, depth (20 bytes a pixel);
emission (16 more) where a surface has any, material (8 more) where one is glossy.

Positions come back from the depth: reversed, in 32 bits, it loses nothing that shows.
"""

from __future__ import annotations

from collections.abc import Mapping

from deferred_ir.frame.facts import EMISSION, GLOSS
from deferred_ir.frame.frame import Frame
from deferred_ir.frame.pass_io import Io
from deferred_ir.frame.uploads.mipmaps import MipmapParams
from deferred_ir.graph.facts import Facts
from deferred_ir.graph.pass_base import Pass
from deferred_ir.graph.ports import Description, Output, Texture


class GBuffer(Pass):
    """Depth, normals and reflectance of the nearest surface in each pixel."""

    Params = MipmapParams

    def outputs(self, inputs: Mapping[str, Description | None]) -> Mapping[str, Output]:
        """Return up to five textures of the frame's size."""
        del inputs
        return {
            "normals": Output(
                "shading and geometric normal, octahedral, towards the viewer", Texture("rgba16"), spare=True
            ),
            "albedo": Output("reflectance, linear RGB; alpha 1 on surfaces", Texture("rgba16f"), spare=True),
            "emission": Output("radiance that surfaces emit, linear RGB", Texture("rgba32f"), spare=True),
            "material": Output("roughness, metallic, number of the material", Texture("rgba16"), spare=True),
            "depth": Output("reversed depth, near/z; 0 is the background", Texture("depth32f")),
        }

    def unneeded_outputs(self, facts: Facts) -> Mapping[str, str]:
        """Leave out emission where no surface has any, and the material where all surfaces are matt."""
        emission = {} if facts[EMISSION] else {"emission": "no surface emits"}
        return emission | ({} if facts[GLOSS] else {"material": "no surface is glossy"})

    def depends(self) -> frozenset[str]:
        """The camera and the models."""
        return frozenset({"camera", "models"})

    def execute(self, frame: Frame, io: Io) -> None:
        """Draw all triangles."""
        for target in range(len(io.framebuffer.colors)):
            io.framebuffer.clear_color(target)
        io.framebuffer.clear_depth()
        ctx = io.gpu.ctx
        ctx.enable(ctx.DEPTH_TEST)
        ctx.depth_func = ">"
        program = io.program("gbuffer.frag", "scene.vert", defines=frame.buffers.defines)
        frame.buffers.draw(program, mipmaps=self.params.mipmaps)


PASS = GBuffer
