"""Shadow maps of the baseline: lights, vpls -> views and one depth texture for each map.

They are drawn one by one and share nothing with the atlas, so that the equivalence test can find a fault in its tiles.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from deferred_ir.frame.cluster_buffers import ClusterBuffers
from deferred_ir.frame.direct_lights import find_view_owners
from deferred_ir.frame.facts import EMITS
from deferred_ir.frame.frame import Frame
from deferred_ir.frame.light_culling import find_shining
from deferred_ir.frame.pass_io import Io
from deferred_ir.gl.textures import GpuTexture
from deferred_ir.graph.facts import Facts
from deferred_ir.graph.pass_base import Pass
from deferred_ir.graph.ports import Buffer, Description, Input, Output, Texture
from deferred_ir.shadows import figures, mesh_choice
from deferred_ir.shadows.paraboloid import MapBatch, draw_curved
from deferred_ir.shadows.settings import MapParams
from deferred_ir.shadows.views import CAPACITY, describe_output, pack_views


class SingleMaps(Pass):
    """A depth map for each view and VPL."""

    Params = MapParams
    figures = figures.ALL
    inputs: ClassVar[Mapping[str, Input]] = {
        "lights": Input("the direct lights to draw maps for", format="light"),
        "vpls": Input("the VPLs to draw maps for", format="vpl"),
    }

    def outputs(self, inputs: Mapping[str, Description | None]) -> Mapping[str, Output]:
        """A texture for each map that the buffers may need."""
        vpls, p = inputs["vpls"], self.params
        count = vpls.records if isinstance(vpls, Buffer) else 0
        single, room = 4 * p.vpl_size**2, p.budget * 2**20 - 4 * CAPACITY * p.spot_size**2
        p.check_budget(count, 4 * CAPACITY * p.spot_size**2 + count * single, room // single)
        size = (p.spot_size, p.spot_size)
        light_maps = Texture("depth32f", size=size, copies=CAPACITY, mend="a smaller shadow_maps.spot_size")
        edge = p.vpl_size if count > 0 else 1
        vpl_maps = Texture("depth32f", (edge, edge), copies=max(count, 1), mend="a smaller shadow_maps.vpl_size")
        return {
            "light_maps": Output("reversed depth from each view of the direct lights", light_maps, p.defines()),
            "vpl_maps": Output("reversed depth from each VPL", vpl_maps, p.defines()),
            "views": describe_output(),
        }

    def unneeded(self, facts: Facts) -> str | None:
        """Return a reason if the spotlight is dark: then there are no VPLs either."""
        return None if facts[EMITS] else "no light needs one: the spotlight emits nothing"

    def explain_shared_error(self, facts: Facts, inputs: Mapping[str, Description | None]) -> str | None:
        """Return what maps cannot resolve."""
        del facts, inputs
        return "shadows are as fine as the maps' texels"

    def depends(self) -> frozenset[str]:
        """The lights and the models; VPLs come as an input."""
        return frozenset({"light", "models"})

    def execute(self, frame: Frame, io: Io) -> None:
        """Draw all triangles for each map."""
        self.params.prepare(io.gpu)
        views = pack_views(frame, self.params, self.params.spot_size)
        shining = find_shining(io["lights"].records)[find_view_owners(frame.scene)]
        io["views"].write(views)
        io["views"].bind()
        scene = frame.buffers.cluster_buffers
        for view in np.flatnonzero(shining):
            curved = bool(views["paraboloid"][view])
            batch = MapBatch(views, np.array([view]), self.params.spot_size, vpls=False, curved=curved)
            self._draw(frame, io, io["light_maps"][view], scene, batch)
        vpls, block = io["vpls"].records, io["vpls"].description.block
        drawn, curved = np.flatnonzero(find_shining(vpls)).tolist(), self.params.projection == "paraboloid"
        mesh = mesh_choice.choose_mesh(frame, self.params) if drawn else scene
        for i in drawn:
            start = i // block * block
            io["vpls"].bind(i // block)
            records, row = vpls[start : start + block], np.array([i - start])
            batch = MapBatch(records, row, self.params.vpl_size, vpls=True, curved=curved)
            self._draw(frame, io, io["vpl_maps"][int(vpls["tile"][i])], mesh, batch)
        io.count(figures.MAPS_DRAWN.name, int(shining.sum()) + len(drawn))
        if drawn:
            mesh_choice.report_size(frame, io, self.params)

    def _draw(self, frame: Frame, io: Io, target: GpuTexture, mesh: ClusterBuffers, batch: MapBatch) -> None:
        """Draw `mesh` into the texture `target`, the only map of `batch`."""
        target.framebuffer.bind()
        target.framebuffer.clear_depth()
        if batch.curved:
            draw_curved(mesh, io, self.params, batch, layered=False)
            return
        program = io.program("shadow_maps/depth.frag", "shadow_maps/single.vert", defines=batch.defines)
        program.set(view_number=int(batch.chosen[0]))
        if mesh is frame.buffers.cluster_buffers:
            frame.buffers.draw(program)
        else:
            mesh.draw_all(program, batch.records[batch.chosen])


PASS = SingleMaps
