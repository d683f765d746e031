"""Shadow maps of the baseline: lights, vpls -> views and one depth texture for each map.

They are drawn one by one and share nothing with the atlas, so that the equivalence test can find a fault in its tiles.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import ClassVar

import numpy as np

from deferred_ir.frame.facts import DIRECT_LIGHTS, EMITS, VIEWS
from deferred_ir.frame.frame import Frame
from deferred_ir.frame.light_culling import find_shining
from deferred_ir.frame.pass_io import Io
from deferred_ir.frame.uploads.cluster_buffers import ClusterBuffers
from deferred_ir.gl.textures import GpuTexture
from deferred_ir.graph.facts import NOTHING_KNOWN, Facts
from deferred_ir.graph.pass_base import Pass
from deferred_ir.graph.ports import Buffer, Description, Input, Output, Texture
from deferred_ir.shadows import figures, mesh_choice
from deferred_ir.shadows.batches import MapBatch, make_batches
from deferred_ir.shadows.layout import explain_resolution, lay_out
from deferred_ir.shadows.paraboloid import draw_curved
from deferred_ir.shadows.settings import MapParams
from deferred_ir.shadows.views import PARABOLOID, describe_output, pack_views, place_views


class SingleMaps(Pass):
    """A depth map for each view and VPL."""

    Params = MapParams
    figures = figures.ALL
    inputs: ClassVar[Mapping[str, Input]] = {
        "lights": Input("the direct lights to draw maps for", format="light"),
        "vpls": Input("the VPLs to draw maps for", format="vpl"),
    }

    def outputs(self, inputs: Mapping[str, Description | None]) -> Mapping[str, Output]:
        """Return what one spotlight needs."""
        return self.outputs_for(NOTHING_KNOWN, inputs)

    def outputs_for(self, facts: Facts, inputs: Mapping[str, Description | None]) -> Mapping[str, Output]:
        """A texture for each map that the buffers may need."""
        vpls, p = inputs["vpls"], self.params
        count = vpls.records if isinstance(vpls, Buffer) else 0
        sizes = lay_out(facts[VIEWS], p, max(p.spot_size, p.vpl_size)).sizes
        single, lights = 4 * p.vpl_size**2, 4 * sum(size**2 for size in sizes)
        p.check_budget(count, lights + count * single, (p.budget * 2**20 - lights) // single)
        size, mend = (max(sizes, default=1),) * 2, "a smaller shadow_maps.spot_size"
        edges = sizes if len(set(sizes)) > 1 else ()
        light_maps = Texture("depth32f", size=size, copies=max(len(sizes), 1), edges=edges, mend=mend)
        edge = p.vpl_size if count > 0 else 1
        vpl_maps = Texture("depth32f", (edge, edge), copies=max(count, 1), mend="a smaller shadow_maps.vpl_size")
        return {
            "light_maps": Output("reversed depth from each view of the direct lights", light_maps, p.defines()),
            "vpl_maps": Output("reversed depth from each VPL", vpl_maps, p.defines()),
            "views": describe_output(facts[DIRECT_LIGHTS], len(facts[VIEWS])),
        }

    def unneeded(self, facts: Facts) -> str | None:
        """Return a reason if nothing shines: then there are no VPLs either."""
        return None if facts[EMITS] else "no light needs one: nothing shines"

    def explain_shared_error(self, facts: Facts, inputs: Mapping[str, Description | None]) -> str | None:
        """Return what maps cannot resolve."""
        del inputs
        return explain_resolution(facts[VIEWS], self.params, max(self.params.spot_size, self.params.vpl_size))

    def depends(self) -> frozenset[str]:
        """The lights and the models; VPLs come as an input."""
        return frozenset({"light", "models"})

    def execute(self, frame: Frame, io: Io) -> None:
        """Draw all triangles for each map."""
        p, described = self.params, frame.light_views
        p.prepare(io.gpu)
        edge = max(p.spot_size, p.vpl_size)
        layout = lay_out([view.halvings for view in described.views], p, edge)
        views, block = pack_views(frame, described, layout, edge), io["views"].description.block
        placed = place_views(views, described.rows, block)
        io["views"].write(placed)
        shining, scene = find_shining(io["lights"].records)[described.owners], frame.buffers.map_meshes
        for view in np.flatnonzero(shining).tolist():
            row = int(described.rows[view])
            start = row // block * block
            io["views"].bind(row // block)
            batch = make_batches(placed[start : start + block], np.array([row - start]), p)
            self._draw(frame, io, io["light_maps"][view], scene, *batch)
        vpls, block = io["vpls"].records, io["vpls"].description.block
        drawn = np.flatnonzero(find_shining(vpls)).tolist()
        meshes = mesh_choice.choose_meshes(frame, p) if drawn else scene
        for i in drawn:
            start = i // block * block
            io["vpls"].bind(i // block)
            batch = make_batches(vpls[start : start + block], np.array([i - start]), p)
            self._draw(frame, io, io["vpl_maps"][int(vpls["tile"][i])], meshes, *batch)
        io.count(figures.MAPS_DRAWN.name, int(shining.sum()) + len(drawn))
        if drawn:
            mesh_choice.report_size(frame, io, p)

    def _draw(
        self, frame: Frame, io: Io, target: GpuTexture, meshes: Sequence[ClusterBuffers], batch: MapBatch
    ) -> None:
        """Draw `meshes` into the texture `target`, the only map of `batch`."""
        target.framebuffer.bind()
        target.framebuffer.clear_depth()
        for mesh in meshes:
            if batch.projection == PARABOLOID:
                draw_curved(mesh, io, self.params, batch, layered=False)
                continue
            defines = {**batch.defines, **mesh.defines}
            program = io.program("shadow_maps/depth.frag", "shadow_maps/single.vert", defines=defines)
            program.set(view_number=int(batch.chosen[0]))
            if mesh is frame.buffers.cluster_buffers:
                frame.buffers.draw(program)
            else:
                mesh.draw_all(program, batch.records[batch.chosen])


PASS = SingleMaps
