"""Shadow maps of all lights in one depth texture array: lights -> atlas.

One pass over all lights, for they are too many and too volatile for a node each. The spotlight owns layer 0, each VPL a
tile on the layers behind it. The pass plans a sub-pass for each light and draws the dirty ones in one indirect call a
block of lights, each cluster of triangles once for every light that may see it: the vertex shader chooses layer and
tile, four clip distances cut the tile out.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np

from deferred_ir.frame.facts import EMITS
from deferred_ir.frame.frame import Frame
from deferred_ir.frame.pass_io import Io
from deferred_ir.graph.facts import Facts
from deferred_ir.graph.pass_base import Pass
from deferred_ir.graph.ports import Buffer, Description, Input, Output, Texture
from deferred_ir.scene.lights.spot import LIGHTS_PER_BLOCK
from deferred_ir.shadows import figures, mesh_choice, paraboloid
from deferred_ir.shadows.atlas_cache import AtlasCache
from deferred_ir.shadows.settings import MapParams


class ShadowMaps(Pass):
    """Depth as each light sees it."""

    Params = MapParams
    figures = figures.ALL
    State = AtlasCache
    inputs: ClassVar[Mapping[str, Input]] = {
        "lights": Input("the lights to draw maps for", format="light"),
        "rays": Input("which lights are seen, by rays: then none needs a map", optional=True, replaces=True),
    }

    def _tiles_per_layer(self) -> int:
        row: int = self._edge() // self.params.vpl_size
        return row * row

    def _edge(self) -> int:
        edge: int = max(self.params.spot_size, self.params.vpl_size)
        return edge

    def outputs(self, inputs: Mapping[str, Description | None]) -> Mapping[str, Output]:
        """The atlas, as large as the lights need."""
        vpls, edge, per_layer = _lights(inputs) - 1, self._edge(), self._tiles_per_layer()
        layers = 1 + -(-vpls // per_layer)
        layer = 4 * edge * edge
        self.params.check_budget(vpls, layers * layer, (self.params.budget * 2**20 // layer - 1) * per_layer)
        self.params.check_layers(vpls, layers, per_layer)
        defines = {**self.params.defines(), "ATLAS_SIZE": edge}
        larger = "spot_size" if edge == self.params.spot_size else "vpl_size"
        atlas = Texture(
            "depth32f", size=(edge, edge), layers=layers, grows=True, mend=f"a smaller shadow_maps.{larger}"
        )
        return {"atlas": Output("reversed depth; layer 0 the spotlight's, then tiles of VPLs", atlas, defines)}

    def unneeded(self, facts: Facts) -> str | None:
        """A dark spotlight makes no VPLs either."""
        return None if facts[EMITS] else "no light needs one: the spotlight emits nothing"

    def depends(self) -> frozenset[str]:
        """The lights come as an input."""
        return frozenset({"models"})

    def subpasses(
        self, inputs: Mapping[str, Description | None], state: AtlasCache | None = None
    ) -> Sequence[Mapping[str, Any]]:
        """A sub-pass for each light that the buffer can hold; after a frame, for each that it holds."""
        per_layer, why = self._tiles_per_layer(), "no frame has drawn it yet"
        spot = {"light": "spotlight", "projection": "perspective", "layer": 0, "tile": 0, "size": self.params.spot_size}
        tiles = [
            {"light": f"vpl {i}", "projection": self.params.projection, "layer": 1 + i // per_layer}
            | {"tile": i % per_layer, "size": self.params.vpl_size}
            for i in range(_lights(inputs) - 1)
        ]
        parts = [{**tile, "state": "dirty", "why": why} for tile in [spot, *tiles]]
        return state.describe(parts) if state and state.frame else parts

    def execute(self, frame: Frame, io: Io) -> None:
        """Clear, then draw for each light what it may see, unless its map is there already."""
        gpu, lights = io.gpu, io["lights"]
        maps = AtlasCache.begin(io, self.params, all_tiles=frame.keep_all)
        self.params.prepare(gpu)
        geometry = [] if gpu.layer_from_vertex else ["shadow_maps/layer.geom"]
        program = io.program("shadow_maps/depth.frag", "shadow_maps/planar.vert", *geometry)
        total = len(lights.records)
        for start in range(0, total, LIGHTS_PER_BLOCK):
            lights.bind_uniform(1, start // LIGHTS_PER_BLOCK)
            records = lights.records[start : min(start + LIGHTS_PER_BLOCK, total)]
            curved, dirty = self.params.paraboloid(records), maps.dirty[start : start + len(records)]
            for mesh, share in mesh_choice.shares(frame, self.params, records):
                drawn = share & dirty
                if (drawn & ~curved).any():
                    gpu.clip(4)
                    planar = np.flatnonzero(drawn & ~curved)
                    mesh.draw(program, mesh.clusters.find_visible(records[planar]), planar)
                if (drawn & curved).any():
                    paraboloid.draw(mesh, io, self.params, records, drawn & curved, layered=True)
        io.state.remember()
        io.count(figures.MAPS_DRAWN.name, int(maps.dirty.sum()))
        if total > 1:
            mesh_choice.count(frame, io, self.params)


def _lights(inputs: Mapping[str, Description | None]) -> int:
    """How many lights may get a map."""
    lights = inputs["lights"]
    return lights.records if isinstance(lights, Buffer) else 1


PASS = ShadowMaps
