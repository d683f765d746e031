"""The mesh that maps of VPLs draw: the scene, or one that stands in for it."""

from __future__ import annotations

from deferred_ir.frame.frame import Frame
from deferred_ir.frame.pass_io import Io
from deferred_ir.frame.uploads.cluster_buffers import ClusterBuffers
from deferred_ir.meshes import levels
from deferred_ir.meshes.clusters import Clusters
from deferred_ir.meshes.posed import MapMesh
from deferred_ir.meshes.subdivide import subdivide_mesh
from deferred_ir.shadows.figures import STAND_IN_BYTES, STAND_IN_TRIANGLES
from deferred_ir.shadows.settings import MapParams


def choose_mesh(frame: Frame, params: MapParams) -> ClusterBuffers:
    """Return the mesh that the maps of VPLs draw; other maps draw the scene."""
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


def report_size(frame: Frame, io: Io, params: MapParams) -> None:
    """Publish the size of the mesh that stands in for the scene, if one does."""
    mesh = choose_mesh(frame, params)
    if mesh is not frame.buffers.cluster_buffers:
        io.report(STAND_IN_TRIANGLES.name, int(mesh.clusters.sizes.sum()))
        io.report(STAND_IN_BYTES.name, mesh.mesh_bytes)
