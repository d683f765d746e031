"""Drawing paraboloid maps: what is small in a map goes there as it is, the rest is split first.

Between its corners a triangle's edges are straight in a map, while lines of the scene are curved in a paraboloid. The
GPU splits edges (shaders/shadow_maps/paraboloid.tesc), but doing so for every triangle and view would cost more than
it is worth: clusters none of whose edges can bend by more than `bend` texels are drawn as they are.
"""

from __future__ import annotations

import numpy as np

from deferred_ir.frame.pass_io import Io
from deferred_ir.frame.uploads.cluster_buffers import ClusterBuffers
from deferred_ir.shadows.batches import MapBatch
from deferred_ir.shadows.settings import LEAST_REACH, MapParams

FILES = ("shadow_maps/paraboloid.frag", "shadow_maps/paraboloid.vert")
SPLIT = ("shadow_maps/paraboloid.tesc", "shadow_maps/paraboloid.tese")


def draw_curved(mesh: ClusterBuffers, io: Io, params: MapParams, batch: MapBatch, *, layered: bool) -> None:
    """Draw `mesh` into paraboloid maps; layered: into an atlas."""
    gpu, clusters, views = io.gpu, mesh.clusters, batch.records[batch.chosen]
    # Where in an image a fragment lies is known of split triangles alone.
    cut = bool(mesh.defines["CUT"])
    straight = batch.vpls and params.tessellation == "pre" and not cut
    visible = batch.find_visible(clusters)
    bent = np.False_ if straight else np.True_ if cut else clusters.find_bent(views, params.reach(views, batch.size))
    gpu.clip(5)  # behind the view, and the map's four sides
    geometry = ["shadow_maps/paraboloid.geom"] if layered and not gpu.layer_from_vertex else []
    for split, drawn in ((False, visible & ~bent), (True, visible & bent)):
        if drawn.any():
            files = [*FILES, *(SPLIT if split else ()), *geometry]
            shape = {"SPLIT": int(split), "STRAIGHT": int(straight), "BEND": float(params.bend)}
            program = io.program(*files, defines={**batch.defines, **shape, **mesh.defines, "LEAST_REACH": LEAST_REACH})
            mesh.draw(program, drawn, batch.chosen, patches=split)
    gpu.clip(0)
