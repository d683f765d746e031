"""Passes that do the least that a pass of the graph `deferred` must do: profiling/limits/bench.py compares."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import ClassVar

from deferred_ir.frame.frame import Frame
from deferred_ir.frame.pass_io import Io
from deferred_ir.graph.pass_base import Pass
from deferred_ir.graph.ports import Description, Input, Output, Texture
from deferred_ir.passes.shadow_maps import ShadowMaps
from deferred_ir.scene.lights.spot import LIGHTS_PER_BLOCK

FOLDER = Path(__file__).parent


class LimitLighting(Pass):
    """One projection and one shadow comparison for each pixel and light; the output counts the lights that arrive."""

    shader_folder = FOLDER
    inputs: ClassVar[Mapping[str, Input]] = {
        "lights": Input("the spotlight, then the VPLs", format="light"),
        "depth": Input("reversed depth", format="depth32f"),
        "shadows": Input("shadow atlas", format="depth32f", linear=True, compare=">="),
    }

    def outputs(self, inputs: Mapping[str, Description | None]) -> Mapping[str, Output]:
        """The target that lighting has."""
        del inputs
        return {"radiance": Output("lights that reach the pixel; 0 on the background", Texture("rgba32f"))}

    def execute(self, frame: Frame, io: Io) -> None:
        """One fullscreen draw a block of lights."""
        del frame
        ctx, lights = io.gpu.ctx, io["lights"]
        program = io.program("limit_lighting.frag")
        ctx.blend_func = ctx.ONE, ctx.ONE
        for start in range(0, len(lights.records), LIGHTS_PER_BLOCK):
            lights.bind_uniform(1, start // LIGHTS_PER_BLOCK)
            program.set(first=int(start == 0), count=min(LIGHTS_PER_BLOCK, len(lights.records) - start))
            program.draw_fullscreen()
            ctx.enable(ctx.BLEND)


class LimitMaps(ShadowMaps):
    """The same triangles from the same lights into one plain depth buffer of as many texels as the atlas.

    One draw a light into a viewport of its own, where the hardware clips: no layers, tiles or clip distances in the
    shaders. Layers of the atlas lie above one another, so that every texel comes out the same.
    """

    def outputs(self, inputs: Mapping[str, Description | None]) -> Mapping[str, Output]:
        """The atlas with its layers laid out."""
        atlas = super().outputs(inputs)["atlas"]
        assert isinstance(atlas.description, Texture)
        assert atlas.description.size
        width, height = atlas.description.size
        plain = Texture("depth32f", size=(width, height * atlas.description.layers))
        return {"atlas": Output("the atlas's layers above one another", plain, atlas.defines)}

    def execute(self, frame: Frame, io: Io) -> None:
        """Clear, then draw the scene for each light."""
        lights, edge = io["lights"], io.framebuffer.size[0]
        io.framebuffer.clear_depth()
        self.params.prepare(io.gpu)
        program = io.program("shadow_maps/depth.frag", "shadow_maps/single.vert")
        maps = self.subpasses({**dict.fromkeys(self.inputs), "lights": lights.description})[: len(lights.records)]
        for i, place in enumerate(maps):
            size, row = place["size"], edge // place["size"]
            if i % LIGHTS_PER_BLOCK == 0:
                lights.bind_uniform(1, i // LIGHTS_PER_BLOCK)
            y, x = divmod(place["tile"], row)
            io.gpu.gl.Viewport(x * size, place["layer"] * edge + y * size, size, size)
            program.set(light_number=i % LIGHTS_PER_BLOCK)
            frame.buffers.draw(program)


LIMITS: Mapping[str, type[Pass]] = {"limit_lighting": LimitLighting, "limit_maps": LimitMaps}
"""By the name of their type; a graph file beside this one, of the same name, puts each in its place."""
