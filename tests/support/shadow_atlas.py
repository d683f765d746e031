"""Reading shadow maps back from the atlas of a Renderer."""

from __future__ import annotations

import numpy as np

from deferred_ir.engine.renderer import Renderer


def read_atlas(one: Renderer) -> np.ndarray:
    """The atlas of the frame drawn last, (layers, H, W), lowest row first; the spotlight's map is the first layer."""
    with one.gpu.ctx:
        return one.executor.resource(("shadow_maps", "atlas")).read()[..., 0]


def read_vpl_maps(one: Renderer, size: int = 32) -> dict[int, np.ndarray]:
    """The maps (size, size) of the VPLs that are alive, by tile."""
    atlas = read_atlas(one)
    per_row = atlas.shape[1] // size
    tiles = one.executor.resource(("vpl", "vpls")).records["tile"].astype(int)
    rows = atlas.reshape(len(atlas), per_row, size, per_row, size).swapaxes(2, 3)
    return {tile: rows[1 + tile // per_row**2, tile % per_row**2 // per_row, tile % per_row] for tile in tiles}
