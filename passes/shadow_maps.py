"""Shadow maps of all lights in one depth texture array: lights, vpls -> atlas, views.

The views of direct lights have the first layers of the atlas, each VPL a tile on the layers behind these. The pass
plans a sub-pass for each map. It draws the dirty maps of a block of VPLs or of views by one indirect call, in which
each cluster of triangles has an instance for every view that may see it: the vertex shader chooses layer and tile, and
four clip distances clip to the tile.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import product
from typing import Any, ClassVar

import numpy as np

from deferred_ir.base.arrays import Ints
from deferred_ir.frame.facts import DIRECT_LIGHTS, EMITS, VIEWS
from deferred_ir.frame.frame import Frame
from deferred_ir.frame.pass_io import Io
from deferred_ir.frame.uploads.cluster_buffers import ClusterBuffers
from deferred_ir.graph.facts import NOTHING_KNOWN, Facts, Statements
from deferred_ir.graph.pass_base import Pass
from deferred_ir.graph.ports import Buffer, Description, Input, Output, Texture
from deferred_ir.shadows import figures, mesh_choice
from deferred_ir.shadows.atlas_cache import AtlasCache
from deferred_ir.shadows.batches import make_batches
from deferred_ir.shadows.layout import explain_resolution, lay_out
from deferred_ir.shadows.paraboloid import draw_curved
from deferred_ir.shadows.settings import SPOT_MAP, MapParams
from deferred_ir.shadows.views import NAMES, PARABOLOID, describe_output, pack_views, place_views


class ShadowMaps(Pass):
    """Depth from each light."""

    Params = MapParams
    figures = figures.ALL
    State = AtlasCache
    inputs: ClassVar[Mapping[str, Input]] = {
        "lights": Input("the direct lights to draw maps for", format="light"),
        "vpls": Input("the VPLs to draw maps for", format="vpl"),
        "rays": Input("which lights are seen, by rays: then none needs a map", optional=True, replaces=True),
        "direct": Input("the direct lights' light, by rays: then they need no maps", optional=True),
    }

    def _tiles_per_layer(self) -> int:
        row: int = self._edge() // self.params.vpl_size
        return row * row

    def _edge(self) -> int:
        edge: int = max(self.params.spot_size, self.params.vpl_size)
        return edge

    def outputs(self, inputs: Mapping[str, Description | None]) -> Mapping[str, Output]:
        """Return what one spotlight needs."""
        return self.outputs_for(NOTHING_KNOWN, inputs)

    def outputs_for(self, facts: Facts, inputs: Mapping[str, Description | None]) -> Mapping[str, Output]:
        """The atlas, as large as the lights need, and the views of the direct lights."""
        vpls, edge, per_layer = _count_vpls(inputs), self._edge(), self._tiles_per_layer()
        first = lay_out(facts[VIEWS], self.params, edge).layers
        layers, layer = first + -(-vpls // per_layer), 4 * edge * edge
        self.params.check_budget(vpls, layers * layer, (self.params.budget * 2**20 // layer - first) * per_layer)
        self.params.check_layers(vpls, layers, per_layer, first)
        defines = {**self.params.defines(), "ATLAS_SIZE": edge, "FIRST_TILE_LAYER": first}
        larger = "spot_size" if edge == self.params.spot_size else "vpl_size"
        atlas = Texture(
            "depth32f", size=(edge, edge), layers=max(layers, 1), grows=True, mend=f"a smaller shadow_maps.{larger}"
        )
        doc = "reversed depth; first layers the direct lights', then tiles of VPLs"
        return {"atlas": Output(doc, atlas, defines), "views": describe_output(facts[DIRECT_LIGHTS], len(facts[VIEWS]))}

    def state_facts(self, facts: Facts) -> Statements:
        """State that the spotlight may have a map."""
        del facts
        return {SPOT_MAP: True}

    def unneeded(self, facts: Facts) -> str | None:
        """Return a reason if nothing shines: then there are no VPLs either."""
        return None if facts[EMITS] else "no light needs one: nothing shines"

    def explain_shared_error(self, facts: Facts, inputs: Mapping[str, Description | None]) -> str | None:
        """Return what maps cannot resolve."""
        del inputs
        return explain_resolution(facts[VIEWS], self.params, self._edge())

    def depends(self) -> frozenset[str]:
        """The lights and the models; VPLs come as an input."""
        return frozenset({"light", "models"})

    def subpasses(
        self, inputs: Mapping[str, Description | None], state: AtlasCache | None = None
    ) -> Sequence[Mapping[str, Any]]:
        """Return a sub-pass for each map that the buffers have room for; after a frame, for each of its lights."""
        per_layer, why = self._tiles_per_layer(), "no frame has drawn it yet"
        layout, lights = state.layout if state else None, inputs["lights"]
        layout = layout or lay_out(
            [0] * (lights.records if isinstance(lights, Buffer) else 1), self.params, self._edge()
        )
        names = state.names if state and state.names else [("spotlight", "perspective")] * len(layout.sizes)
        views = [
            {"light": name, "projection": projection, "layer": layer, "tile": 0, "corner": (x, y), "size": size}
            for (name, projection), (layer, x, y), size in zip(names, layout.places, layout.sizes, strict=True)
        ]
        tiles = [
            {"light": f"vpl {i}", "projection": self.params.projection, "layer": layout.layers + i // per_layer}
            | {"tile": i % per_layer, "size": self.params.vpl_size}
            for i in range(_count_vpls(inputs))
        ]
        parts = [{**tile, "state": "dirty", "why": why} for tile in [*views, *tiles]]
        if state and state.frame:
            return state.describe(parts)
        return parts[len(views) :] if inputs["direct"] else parts

    def execute(self, frame: Frame, io: Io) -> None:
        """Clear and draw the maps that the atlas does not hold already."""
        described, vpls = frame.light_views, io["vpls"].records
        layout = lay_out([view.halvings for view in described.views], self.params, self._edge())
        views = pack_views(frame, described, layout, self._edge())
        block = io["views"].description.block
        placed = place_views(views, described.rows, block)
        io["views"].write(placed)
        used = 0 if io["direct"] else len(views)
        projections = [NAMES[number] for number in views["projection"].astype(int)]
        kinds = [frame.scene.direct_lights[owner].kind for owner in described.owners]
        io.state.names = list(zip(kinds, projections, strict=True))
        maps = AtlasCache.begin(io, self.params, described.owners[:used], layout, all_tiles=frame.keep_all)
        self.params.prepare(io.gpu)
        for start in range(0, len(placed) if used else 0, block):
            io["views"].bind(start // block)
            here = np.flatnonzero(maps.dirty[:used] & (described.rows[:used] // block == start // block))
            self._draw(frame.buffers.map_meshes, io, placed[start : start + block], described.rows[here] - start)
        if len(vpls):
            meshes = mesh_choice.choose_meshes(frame, self.params)
            block, dirty = io["vpls"].description.block, maps.dirty[used:]
            for start in range(0, len(vpls), block):
                io["vpls"].bind(start // block)
                self._draw(meshes, io, vpls[start : start + block], np.flatnonzero(dirty[start : start + block]))
            mesh_choice.report_size(frame, io, self.params)
        io.state.remember()
        io.count(figures.MAPS_DRAWN.name, int(maps.dirty.sum()))

    def _draw(self, meshes: Sequence[ClusterBuffers], io: Io, records: np.ndarray, chosen: Ints) -> None:
        """Draw `meshes` into the maps of the rows `chosen` of the bound block of views or VPLs, `records`."""
        for mesh, batch in product(meshes, make_batches(records, chosen, self.params)):
            if batch.projection == PARABOLOID:
                draw_curved(mesh, io, self.params, batch, layered=True)
                continue
            geometry = [] if io.gpu.layer_from_vertex else ["shadow_maps/layer.geom"]
            files = "shadow_maps/depth.frag", "shadow_maps/planar.vert", *geometry
            program = io.program(*files, defines={**batch.defines, **mesh.defines})
            io.gpu.clip(4)
            mesh.draw(program, batch.find_visible(mesh.clusters), batch.chosen)


def _count_vpls(inputs: Mapping[str, Description | None]) -> int:
    """Return how many VPLs may get a map."""
    vpls = inputs["vpls"]
    return vpls.records if isinstance(vpls, Buffer) else 0


PASS = ShadowMaps
