"""Shadow maps the plain way, for the baseline: lights -> spot, vpls, one depth texture for each light.

Drawn light by light with nothing of the atlas, so that a fault in its tiles cannot hide from the comparison.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from deferred_ir.frame.facts import EMITS
from deferred_ir.frame.frame import Frame
from deferred_ir.frame.light_culling import shining
from deferred_ir.frame.pass_io import Io
from deferred_ir.graph.facts import Facts
from deferred_ir.graph.pass_base import Pass
from deferred_ir.graph.ports import Buffer, Description, Input, Output, Texture
from deferred_ir.scene.lights.spot import LIGHTS_PER_BLOCK
from deferred_ir.shadows import figures, mesh_choice, paraboloid
from deferred_ir.shadows.settings import MapParams


class PlainMaps(Pass):
    """A depth map for each light."""

    Params = MapParams
    figures = figures.ALL
    inputs: ClassVar[Mapping[str, Input]] = {"lights": Input("the lights to draw maps for", format="light")}

    def outputs(self, inputs: Mapping[str, Description | None]) -> Mapping[str, Output]:
        """A texture for each light that the buffer can hold."""
        lights, p = inputs["lights"], self.params
        count = lights.records if isinstance(lights, Buffer) else 1
        single, room = 4 * p.vpl_size**2, p.budget * 2**20 - 4 * p.spot_size**2
        p.check_budget(count - 1, 4 * p.spot_size**2 + (count - 1) * single, room // single)
        spot = Texture("depth32f", size=(p.spot_size, p.spot_size), copies=1, mend="a smaller shadow_maps.spot_size")
        edge = p.vpl_size if count > 1 else 1
        vpls = Texture("depth32f", (edge, edge), copies=max(count - 1, 1), mend="a smaller shadow_maps.vpl_size")
        return {
            "spot": Output("reversed depth from the spotlight", spot, p.defines()),
            "vpls": Output("reversed depth from each VPL", vpls, p.defines()),
        }

    def unneeded(self, facts: Facts) -> str | None:
        """A dark spotlight makes no VPLs either."""
        return None if facts[EMITS] else "no light needs one: the spotlight emits nothing"

    def depends(self) -> frozenset[str]:
        """The lights come as an input."""
        return frozenset({"models"})

    def execute(self, frame: Frame, io: Io) -> None:
        """Draw all triangles for each light."""
        self.params.prepare(io.gpu)
        program = io.program("shadow_maps/depth.frag", "shadow_maps/single.vert")
        lights, textures = io["lights"], [*io["spot"], *io["vpls"]]
        curved = self.params.paraboloid(lights.records)
        drawn = np.flatnonzero(shining(lights.records))
        for i in drawn.tolist():
            block, number = divmod(i, LIGHTS_PER_BLOCK)
            lights.bind_uniform(1, block)
            framebuffer = textures[int(lights.records["tile"][i]) + 1].framebuffer
            framebuffer.bind()
            framebuffer.clear_depth()
            own = frame.buffers.cluster_buffers
            mesh = mesh_choice.of_vpls(frame, self.params) if i else own
            if curved[i]:
                records = lights.records[block * LIGHTS_PER_BLOCK :][:LIGHTS_PER_BLOCK]
                only = np.arange(len(records)) == number
                paraboloid.draw(mesh, io, self.params, records, only, layered=False)
            else:
                program.set(light_number=number)
                if mesh is own:
                    frame.buffers.draw(program)
                else:
                    mesh.draw_all(program, lights.records[i : i + 1])
        io.count(figures.MAPS_DRAWN.name, len(drawn))
        if drawn.any():
            mesh_choice.count(frame, io, self.params)


PASS = PlainMaps
