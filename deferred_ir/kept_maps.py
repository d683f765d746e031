"""Which maps of an atlas are there already: those drawn for lights that say, by their version, that they stay."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from .gl.resources import GpuTexture
from .io import Io
from .maps import MapParams
from .typing import Bools, Ints


@dataclass
class KeptMaps:
    """What an atlas holds. Place 0 is the spotlight's layer, place 1 + t tile t of the VPLs.

    params: with which it was drawn. places, versions: int (n,), of the lights of the frame; no versions: every map is
    drawn in every frame. dirty: bool (n,), which of them must be drawn. held: int (all places,), the version of the
    light whose map is in each place, 0 for none.
    """

    params: MapParams
    places: Ints
    versions: Ints | None
    dirty: Bools
    held: Ints

    @classmethod
    def of(cls, io: Io, params: MapParams) -> KeptMaps:
        """For the frame at hand: clears the places of lights that must be drawn, or the whole atlas."""
        atlas, lights = io["atlas"], io["lights"]
        places = lights.records["tile"].astype(int) + 1
        versions = lights.versions
        before: KeptMaps | None = atlas.kept
        if versions is not None and before and before.versions is not None and before.params == params:
            kept = cls(params, places, versions, before.held[places] != versions, before.held)
            kept.clear(atlas)
        else:
            io.framebuffer.clear_depth()
            tiles = (atlas.description.layers - 1) * (atlas.size[0] // params.vpl_size) ** 2
            kept = cls(params, places, versions, np.ones(len(places), bool), np.zeros(1 + tiles, np.int64))
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
            self.held[self.places] = self.versions

    def told(self, parts: Sequence[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
        """Of `parts`, one for each place, those of the frame's lights, and whether their maps were drawn in it."""
        if self.versions is None:
            return [parts[place] for place in self.places]
        return [
            {**parts[place], "state": "dirty", "why": "its light is new, or has moved"}
            if dirty
            else {**parts[place], "state": "kept", "why": "its light stays"}
            for place, dirty in zip(self.places, self.dirty, strict=True)
        ]
