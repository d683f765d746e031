"""Drawing paraboloid maps: what is small in a map goes there as it is, the rest is split first.

Between its corners a triangle's edges are straight in a map, while lines of the scene are curved in a paraboloid. The
GPU splits edges (shaders/shadow_maps/paraboloid.tesc), but doing so for every triangle and light would cost more than
it is worth: clusters none of whose edges can bend by more than `bend` texels are drawn as they are.
"""

from __future__ import annotations

import numpy as np

from deferred_ir.base.arrays import Bools
from deferred_ir.frame.cluster_buffers import ClusterBuffers
from deferred_ir.frame.pass_io import Io
from deferred_ir.shadows.settings import LEAST_REACH, MapParams

FILES = ("shadow_maps/paraboloid.frag", "shadow_maps/paraboloid.vert")
SPLIT = ("shadow_maps/paraboloid.tesc", "shadow_maps/paraboloid.tese")


def draw(mesh: ClusterBuffers, io: Io, params: MapParams, records: np.ndarray, chosen: Bools, *, layered: bool) -> None:
    """Draw `mesh` for the lights `chosen`, bool (n,), of the bound block, whose records (n,) are given.

    layered: into an atlas.
    """
    gpu, clusters = io.gpu, mesh.clusters
    lights = np.flatnonzero(chosen)
    records = records[lights]
    visible = clusters.find_visible(records, hemisphere=True)
    straight = params.tessellation == "pre" and (records["tile"] >= 0).all()
    bent = np.False_ if straight else clusters.find_bent(records, params.reach(records))
    gpu.clip(5)  # behind the light, and the map's four sides
    geometry = ["shadow_maps/paraboloid.geom"] if layered and not gpu.layer_from_vertex else []
    for split, share in ((False, visible & ~bent), (True, visible & bent)):
        if share.any():
            files = [*FILES, *(SPLIT if split else ()), *geometry]
            defines: dict[str, int | float] = {"SPLIT": int(split), "STRAIGHT": int(straight)}
            defines |= {"BEND": float(params.bend), "LEAST_REACH": LEAST_REACH}
            program = io.program(*files, defines=defines)
            mesh.draw(program, share, lights, patches=split)
    gpu.clip(0)
