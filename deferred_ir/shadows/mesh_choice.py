"""Which triangles each light's map draws: the scene's own, or for VPLs a mesh that stands in for them."""

from __future__ import annotations

import numpy as np

from deferred_ir.base.arrays import Bools
from deferred_ir.frame.cluster_buffers import ClusterBuffers
from deferred_ir.frame.frame import Frame
from deferred_ir.frame.pass_io import Io
from deferred_ir.meshes import levels
from deferred_ir.meshes.clusters import Clusters
from deferred_ir.meshes.posed import MapMesh
from deferred_ir.meshes.subdivide import subdivide_mesh
from deferred_ir.shadows.figures import STAND_IN_BYTES, STAND_IN_TRIANGLES
from deferred_ir.shadows.settings import MapParams


def of_vpls(frame: Frame, params: MapParams) -> ClusterBuffers:
    """What the maps of VPLs draw."""
    buffers, geometry = frame.buffers, frame.scene.geometry.rest
    if params.projection == "paraboloid" and params.tessellation == "pre":
        longest = params.edge * geometry.diagonal
        return buffers.stand_in(("edge", params.edge), lambda: subdivide_mesh(MapMesh.from_geometry(geometry), longest))
    if params.vpl_deviation > 0:

        def cluster(mesh: MapMesh) -> Clusters:
            return levels.LevelClusters(mesh, levels.find_levels(geometry), params.tolerance)

        key = ("detail", params.vpl_deviation, params.vpl_size, params.projection)
        return buffers.stand_in(key, lambda: levels.make_mesh(geometry), cluster)
    return buffers.cluster_buffers


def shares(frame: Frame, params: MapParams, records: np.ndarray) -> list[tuple[ClusterBuffers, Bools]]:
    """Meshes, and which of the lights with LIGHT records (n,) draw each, bool (n,). The spotlight draws the scene."""
    own, vpls = frame.buffers.cluster_buffers, records["tile"] >= 0
    other = of_vpls(frame, params) if vpls.any() else own
    if other is own:
        return [(own, np.ones(len(records), bool))]
    return [(mesh, lights) for mesh, lights in ((own, ~vpls), (other, vpls)) if lights.any()]


def count(frame: Frame, io: Io, params: MapParams) -> None:
    """Publish how large the mesh is that stands in for the scene, if one does."""
    mesh = of_vpls(frame, params)
    if mesh is not frame.buffers.cluster_buffers:
        io.report(STAND_IN_TRIANGLES.name, int(mesh.clusters.sizes.sum()))
        io.report(STAND_IN_BYTES.name, mesh.mesh_bytes)
