"""Shadow maps of all lights in one depth texture array: lights, vpls -> atlas, views.

Each view of a direct light has a layer of the atlas, each VPL a tile on the layers behind these. The pass plans a
sub-pass for each map. It draws the dirty maps of a block of VPLs by one indirect call, in which each cluster of
triangles has an instance for every view that may see it: the vertex shader chooses layer and tile, and four clip
distances clip to the tile.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np

from deferred_ir.frame.cluster_buffers import ClusterBuffers
from deferred_ir.frame.direct_lights import find_view_owners
from deferred_ir.frame.facts import EMITS
from deferred_ir.frame.frame import Frame
from deferred_ir.frame.pass_io import Io
from deferred_ir.graph.facts import Facts, Statements
from deferred_ir.graph.pass_base import Pass
from deferred_ir.graph.ports import Buffer, Description, Input, Output, Texture
from deferred_ir.shadows import figures, mesh_choice
from deferred_ir.shadows.atlas_cache import AtlasCache
from deferred_ir.shadows.paraboloid import MapBatch, draw_curved
from deferred_ir.shadows.settings import SPOT_MAP, MapParams
from deferred_ir.shadows.views import CAPACITY, describe_output, pack_views


class ShadowMaps(Pass):
    """Depth from each light."""

    Params = MapParams
    figures = figures.ALL
    State = AtlasCache
    inputs: ClassVar[Mapping[str, Input]] = {
        "lights": Input("the direct lights to draw maps for", format="light"),
        "vpls": Input("the VPLs to draw maps for", format="vpl"),
        "rays": Input("which lights are seen, by rays: then none needs a map", optional=True, replaces=True),
        "spotlight": Input("the spotlight's light, by rays: then it needs no map", format="r32f", optional=True),
    }

    def _tiles_per_layer(self) -> int:
        row: int = self._edge() // self.params.vpl_size
        return row * row

    def _edge(self) -> int:
        edge: int = max(self.params.spot_size, self.params.vpl_size)
        return edge

    def outputs(self, inputs: Mapping[str, Description | None]) -> Mapping[str, Output]:
        """The atlas, as large as the lights need, and the views of the direct lights."""
        vpls, edge, per_layer = _count_vpls(inputs), self._edge(), self._tiles_per_layer()
        layers = CAPACITY + -(-vpls // per_layer)
        layer = 4 * edge * edge
        self.params.check_budget(vpls, layers * layer, (self.params.budget * 2**20 // layer - CAPACITY) * per_layer)
        self.params.check_layers(vpls, layers, per_layer)
        defines = {**self.params.defines(), "ATLAS_SIZE": edge, "FIRST_TILE_LAYER": CAPACITY}
        larger = "spot_size" if edge == self.params.spot_size else "vpl_size"
        atlas = Texture(
            "depth32f", size=(edge, edge), layers=layers, grows=True, mend=f"a smaller shadow_maps.{larger}"
        )
        doc = "reversed depth; layer 0 the spotlight's, then tiles of VPLs"
        return {"atlas": Output(doc, atlas, defines), "views": describe_output()}

    def state_facts(self, facts: Facts) -> Statements:
        """State that the spotlight may have a map."""
        del facts
        return {SPOT_MAP: True}

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

    def subpasses(
        self, inputs: Mapping[str, Description | None], state: AtlasCache | None = None
    ) -> Sequence[Mapping[str, Any]]:
        """Return a sub-pass for each map that the buffers have room for; after a frame, for each of its lights."""
        per_layer, why = self._tiles_per_layer(), "no frame has drawn it yet"
        spot = {"light": "spotlight", "projection": "perspective", "layer": 0, "tile": 0, "size": self.params.spot_size}
        tiles = [
            {"light": f"vpl {i}", "projection": self.params.projection, "layer": CAPACITY + i // per_layer}
            | {"tile": i % per_layer, "size": self.params.vpl_size}
            for i in range(_count_vpls(inputs))
        ]
        parts = [{**tile, "state": "dirty", "why": why} for tile in [spot, *tiles]]
        if state and state.frame:
            return state.describe(parts)
        return parts[1:] if inputs["spotlight"] else parts

    def execute(self, frame: Frame, io: Io) -> None:
        """Clear and draw the maps that the atlas does not hold already."""
        views, vpls = pack_views(frame, self.params, self._edge()), io["vpls"].records
        io["views"].write(views)
        owners = find_view_owners(frame.scene)[: 0 if io["spotlight"] else None]
        maps = AtlasCache.begin(io, self.params, owners, all_tiles=frame.keep_all)
        self.params.prepare(io.gpu)
        io["views"].bind()
        for curved in (False, True):
            drawn = views[: len(owners)]
            chosen = np.flatnonzero(maps.dirty[: len(drawn)] & ((drawn["paraboloid"] > 0) == curved))
            batch = MapBatch(views, chosen, self.params.spot_size, vpls=False, curved=curved)
            self._draw(frame.buffers.cluster_buffers, io, batch)
        if len(vpls):
            mesh, curved = mesh_choice.choose_mesh(frame, self.params), self.params.projection == "paraboloid"
            block, dirty = io["vpls"].description.block, maps.dirty[len(owners) :]
            for start in range(0, len(vpls), block):
                io["vpls"].bind(start // block)
                chosen = np.flatnonzero(dirty[start : start + block])
                records = vpls[start : start + block]
                self._draw(mesh, io, MapBatch(records, chosen, self.params.vpl_size, vpls=True, curved=curved))
            mesh_choice.report_size(frame, io, self.params)
        io.state.remember()
        io.count(figures.MAPS_DRAWN.name, int(maps.dirty.sum()))

    def _draw(self, mesh: ClusterBuffers, io: Io, batch: MapBatch) -> None:
        """Draw `mesh` into the maps of `batch`."""
        if not len(batch.chosen):
            return
        if batch.curved:
            draw_curved(mesh, io, self.params, batch, layered=True)
            return
        geometry = [] if io.gpu.layer_from_vertex else ["shadow_maps/layer.geom"]
        program = io.program("shadow_maps/depth.frag", "shadow_maps/planar.vert", *geometry, defines=batch.defines)
        io.gpu.clip(4)
        mesh.draw(program, mesh.clusters.find_visible(batch.records[batch.chosen]), batch.chosen)


def _count_vpls(inputs: Mapping[str, Description | None]) -> int:
    """Return how many VPLs may get a map."""
    vpls = inputs["vpls"]
    return vpls.records if isinstance(vpls, Buffer) else 0


PASS = ShadowMaps
