"""Which maps of an atlas are there already: those drawn for lights that say, by their version, that they stay."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from deferred_ir.base.arrays import Bools, Ints
from deferred_ir.frame.light_culling import shining
from deferred_ir.frame.pass_io import Io
from deferred_ir.gl.textures import GpuTexture
from deferred_ir.shadows.settings import MapParams


@dataclass
class KeptMaps:
    """What an atlas holds. Place 0 is the spotlight's layer, place 1 + t tile t of the VPLs.

    params: with which it was drawn. places, versions: int (n,), of the lights of the frame; no versions: every map is
    drawn in every frame. shining: bool (n,), which of them have power, and so need a map. dirty: bool (n,), which must
    be drawn. held: int (all places,), the version of the light whose map is in each place, 0 for none.
    """

    params: MapParams
    places: Ints
    versions: Ints | None
    shining: Bools
    dirty: Bools
    held: Ints

    @classmethod
    def of(cls, io: Io, params: MapParams, *, all_tiles: bool) -> KeptMaps:
        """For the frame at hand: clears the places of lights that must be drawn, or the whole atlas.

        all_tiles: there is room for all lights that there may ever be; else, unless maps are kept, for those there are.
        """
        atlas, lights = io["atlas"], io["lights"]
        places = lights.records["tile"].astype(int) + 1
        versions, lit = lights.versions, shining(lights.records)
        per_layer = (atlas.size[0] // params.vpl_size) ** 2
        layers = atlas.description.layers
        if versions is None and not all_tiles:
            layers = 1 - (-int(places[lit].max(initial=0)) // per_layer)
        io.fit("atlas", layers)
        before: KeptMaps | None = atlas.kept
        if versions is not None and before and before.versions is not None and before.params == params:
            kept = cls(params, places, versions, lit, lit & (before.held[places] != versions), before.held)
            kept.clear(atlas)
        else:
            io.framebuffer.clear_depth()
            held = np.zeros(1 + (atlas.description.layers - 1) * per_layer, np.int64)
            kept = cls(params, places, versions, lit, lit, held)
        atlas.kept = kept
        return kept

    def clear(self, atlas: GpuTexture) -> None:
        """Make room for the maps that must be drawn."""
        edge = self.params.vpl_size
        per_row = atlas.size[0] // edge
        for place in self.places[self.dirty]:
            if place == 0:
                atlas.clear_part(0, (0, 0), self.params.spot_size)
            else:
                layer, tile = divmod(int(place) - 1, per_row**2)
                atlas.clear_part(1 + layer, (tile % per_row * edge, tile // per_row * edge), edge)

    def remember(self) -> None:
        """They are drawn."""
        if self.versions is not None:
            self.held[self.places[self.dirty]] = self.versions[self.dirty]

    def told(self, parts: Sequence[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
        """Of `parts`, one for each place, those of the frame's lights, and whether their maps were drawn in it."""
        told: list[Mapping[str, Any]] = []
        for place, lit, dirty in zip(self.places, self.shining, self.dirty, strict=True):
            if not lit:
                told.append({**parts[place], "state": "left out", "why": "it lights nothing that is seen"})
            elif self.versions is None:
                told.append({**parts[place], "why": "every frame redoes everything"})
            elif dirty:
                told.append({**parts[place], "state": "dirty", "why": "its light is new, or it or a model has moved"})
            else:
                told.append({**parts[place], "state": "kept", "why": "its light stays"})
        return told
