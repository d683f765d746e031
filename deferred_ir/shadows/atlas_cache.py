"""Reuse of the shadow maps in an atlas: a map is valid while its light keeps its version."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from deferred_ir.base.arrays import Bools, Ints
from deferred_ir.frame.light_culling import find_shining
from deferred_ir.frame.pass_io import Io
from deferred_ir.gl.textures import GpuTexture
from deferred_ir.shadows.layout import ViewLayout
from deferred_ir.shadows.settings import MapParams


@dataclass(frozen=True)
class FrameMaps:
    """The maps of one frame: first those of the direct lights' views, then those of the VPLs.

    places, versions: int (n,); without versions every frame draws every map. shining: bool (n,), lights that have power
    and therefore need a map. dirty: bool (n,), maps that must be drawn.
    """

    places: Ints
    versions: Ints | None
    shining: Bools
    dirty: Bools


class AtlasCache:
    """The maps that an atlas holds from frame to frame, by place: views of direct lights first, then tiles of VPLs.

    params: the parameters that the maps were drawn with. versions: int (places,), the version of the light whose map is
    in each place; 0 if there is none. layout: of the maps of direct lights, and names: the kinds of their lights and
    the projections, in the last frame.
    """

    def __init__(self) -> None:
        self.params: MapParams | None = None
        self.versions: Ints = np.zeros(0, np.int64)
        self.frame: FrameMaps | None = None
        self.layout: ViewLayout | None = None
        self.names: list[tuple[str, str]] = []

    @staticmethod
    def begin(io: Io, params: MapParams, owners: Ints, layout: ViewLayout, *, all_tiles: bool) -> FrameMaps:
        """Clear the places whose maps this frame must draw, or the whole atlas, and return the frame's maps.

        owners: int (views,), the number of the direct light that each view that is drawn belongs to. layout: of all.
        all_tiles: give the atlas room for every light that there may ever be. Otherwise it has room for the lights of
        the frame, unless their maps can be used again.
        """
        atlas, lights, vpls = io["atlas"], io["lights"], io["vpls"]
        tiles = vpls.records["tile"].astype(int)
        places = np.concatenate([np.arange(len(owners)), len(layout.sizes) + tiles])
        shining = find_shining(vpls.records)
        lit = np.concatenate([find_shining(lights.records)[owners], shining])
        reusable = lights.versions is not None and vpls.versions is not None
        versions = np.concatenate([lights.versions[owners], vpls.versions]) if reusable else None
        per_layer = (atlas.size[0] // params.vpl_size) ** 2
        layers = atlas.description.layers
        if versions is None and not all_tiles:
            layers = layout.layers - (-(1 + int(tiles[shining].max(initial=-1))) // per_layer)
        io.fit("atlas", max(layers, 1))
        cache: AtlasCache = io.state  # a new one if the atlas did not fit
        before, same = cache.frame, cache.params == params and cache.layout == layout
        cache.layout = layout
        if versions is not None and before and before.versions is not None and same:
            cache.frame = FrameMaps(places, versions, lit, lit & (cache.versions[places] != versions))
            cache._clear_dirty(atlas, cache.frame, params)
        else:
            io.framebuffer.clear_depth()
            behind = atlas.description.layers - layout.layers
            cache.versions = np.zeros(len(layout.sizes) + behind * per_layer, np.int64)
            cache.params, cache.frame = params, FrameMaps(places, versions, lit, lit)
        return cache.frame

    def _clear_dirty(self, atlas: GpuTexture, frame: FrameMaps, params: MapParams) -> None:
        assert self.layout
        edge, views = params.vpl_size, len(self.layout.sizes)
        per_row = atlas.size[0] // edge
        for place in frame.places[frame.dirty].tolist():
            if place < views:
                layer, x, y = self.layout.places[place]
                atlas.clear_part(layer, (x, y), self.layout.sizes[place])
            else:
                layer, tile = divmod(place - views, per_row**2)
                atlas.clear_part(self.layout.layers + layer, (tile % per_row * edge, tile // per_row * edge), edge)

    def remember(self) -> None:
        """Note that the frame's maps are drawn."""
        frame = self.frame
        if frame and frame.versions is not None:
            self.versions[frame.places[frame.dirty]] = frame.versions[frame.dirty]

    def describe(self, parts: Sequence[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
        """Return those of `parts`, one for each place, that the last frame's lights have, and what became of each."""
        frame, found = self.frame, list[Mapping[str, Any]]()
        assert frame
        for place, lit, dirty in zip(frame.places, frame.shining, frame.dirty, strict=True):
            if not lit:
                found.append({**parts[place], "state": "left out", "why": "it lights nothing that is seen"})
            elif frame.versions is None:
                found.append({**parts[place], "why": "every frame redoes everything"})
            elif dirty:
                found.append({**parts[place], "state": "dirty", "why": "its light is new, or it or a model has moved"})
            else:
                found.append({**parts[place], "state": "kept", "why": "its light stays"})
        return found
