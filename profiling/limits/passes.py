"""Passes that do the least work a pass of the graph `deferred` needs; bench.py compares both."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar

from deferred_ir.frame.frame import Frame
from deferred_ir.frame.pass_io import Io
from deferred_ir.frame.vpl_buffer import VPLS_PER_BLOCK
from deferred_ir.gl.shaders import Program
from deferred_ir.graph.facts import Facts
from deferred_ir.graph.pass_base import Pass
from deferred_ir.graph.ports import Description, Input, Output, Texture
from deferred_ir.passes.shadow_maps import ShadowMaps
from deferred_ir.shadows.layout import lay_out
from deferred_ir.shadows.views import PLANAR, pack_views

FOLDER = Path(__file__).parent


class LimitLighting(Pass):
    """One projection and one shadow comparison for each pixel and light; the output counts the lights that arrive."""

    shader_folder = FOLDER
    inputs: ClassVar[Mapping[str, Input]] = {
        "lights": Input("the direct lights", format="light"),
        "vpls": Input("the VPLs", format="vpl"),
        "views": Input("where the direct lights' maps are", format="view"),
        "depth": Input("reversed depth", format="depth32f"),
        "shadows": Input("shadow atlas", format="depth32f", linear=True, compare=">="),
    }

    def outputs(self, inputs: Mapping[str, Description | None]) -> Mapping[str, Output]:
        """Declare the same target as lighting."""
        del inputs
        return {"radiance": Output("lights that reach the pixel; 0 on the background", Texture("rgba32f"))}

    def execute(self, frame: Frame, io: Io) -> None:
        """Draw one fullscreen triangle a block of VPLs."""
        del frame
        ctx, vpls = io.gpu.ctx, io["vpls"]
        io["lights"].bind()
        io["views"].bind()
        program = io.program("limit_lighting.frag", defines={"MIXED": 0, "VIEWS_PER_LIGHT": 1})
        ctx.blend_func = ctx.ONE, ctx.ONE
        for start in range(0, max(len(vpls.records), 1), VPLS_PER_BLOCK):
            vpls.bind(start // VPLS_PER_BLOCK)
            direct = len(io["lights"].records) if start == 0 else 0
            program.set(direct=direct, count=min(VPLS_PER_BLOCK, len(vpls.records) - start))
            program.draw_fullscreen()
            ctx.enable(ctx.BLEND)


class LimitMaps(ShadowMaps):
    """Draws the same triangles from the same lights into one depth buffer with as many texels as the atlas.

    One draw a light into a viewport of its own, where the hardware clips: no layers, tiles or clip distances in the
    shaders. Layers of the atlas lie above one another, so that every texel comes out the same.
    """

    def outputs_for(self, facts: Facts, inputs: Mapping[str, Description | None]) -> Mapping[str, Output]:
        """Declare the atlas with its layers above one another."""
        outputs = super().outputs_for(facts, inputs)
        atlas = outputs["atlas"]
        assert isinstance(atlas.description, Texture)
        assert atlas.description.size
        width, height = atlas.description.size
        plain = Texture("depth32f", size=(width, height * atlas.description.layers))
        doc = "the atlas's layers above one another"
        return {"atlas": Output(doc, plain, atlas.defines), "views": outputs["views"]}

    def execute(self, frame: Frame, io: Io) -> None:
        """Clear, then draw the scene for each light."""
        vpls, edge = io["vpls"], io.framebuffer.size[0]
        io.framebuffer.clear_depth()
        self.params.prepare(io.gpu)
        described = frame.light_views
        layout = lay_out([view.halvings for view in described.views], self.params, edge)
        views = pack_views(frame, described, layout, edge)
        io["views"].write(views)
        io["views"].bind()
        spot, *tiles = self.subpasses({**dict.fromkeys(self.inputs), "vpls": vpls.description})
        files = "shadow_maps/depth.frag", "shadow_maps/single.vert"
        self._draw_map(frame, io, io.program(*files, defines={"DRAWS_VPLS": 0, "DRAWN_PROJECTION": PLANAR}), spot, 0)
        program = io.program(*files, defines={"DRAWS_VPLS": 1, "DRAWN_PROJECTION": PLANAR})
        for i, place in enumerate(tiles[: len(vpls.records)]):
            if i % VPLS_PER_BLOCK == 0:
                vpls.bind(i // VPLS_PER_BLOCK)
            self._draw_map(frame, io, program, place, i % VPLS_PER_BLOCK)

    def _draw_map(self, frame: Frame, io: Io, program: Program, place: Mapping[str, Any], number: int) -> None:
        edge, size = io.framebuffer.size[0], place["size"]
        y, x = divmod(place["tile"], edge // size)
        io.gpu.gl.Viewport(x * size, place["layer"] * edge + y * size, size, size)
        program.set(view_number=number)
        frame.buffers.draw(program)


LIMITS: Mapping[str, type[Pass]] = {"limit_lighting": LimitLighting, "limit_maps": LimitMaps}
"""Pass types by name; for each, a graph file of the same name beside this file uses it."""
