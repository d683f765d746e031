"""The mesh that maps of VPLs draw: the scene, or one that stands in for it."""

from __future__ import annotations

from deferred_ir.frame.frame import Frame
from deferred_ir.frame.pass_io import Io
from deferred_ir.frame.uploads.cluster_buffers import ClusterBuffers
from deferred_ir.frame.uploads.scene_buffers import SceneBuffers
from deferred_ir.meshes import levels
from deferred_ir.meshes.clusters import Clusters
from deferred_ir.meshes.posed import MapMesh
from deferred_ir.meshes.subdivide import subdivide_mesh
from deferred_ir.scene.geometry import Geometry
from deferred_ir.shadows.figures import STAND_IN_BYTES, STAND_IN_TRIANGLES
from deferred_ir.shadows.settings import MapParams


def choose_meshes(frame: Frame, params: MapParams) -> list[ClusterBuffers]:
    """Return what the maps of VPLs draw; other maps draw the scene. Triangles with holes are drawn as they are."""
    buffers, scene = frame.buffers, frame.buffers.map_meshes
    geometry = buffers.whole_geometry
    if geometry is None:
        return scene
    whole = _choose_mesh(buffers, geometry, params)
    return scene if whole is None else [whole, *scene[1:]]


def _choose_mesh(buffers: SceneBuffers, geometry: Geometry, params: MapParams) -> ClusterBuffers | None:
    """Return the mesh that stands in for triangles without holes, if one does."""
    if params.projection == "paraboloid" and params.tessellation == "pre":
        longest = params.edge * geometry.diagonal
        return buffers.stand_in(("edge", params.edge), lambda: subdivide_mesh(MapMesh.from_geometry(geometry), longest))
    if params.vpl_deviation > 0:

        def cluster(mesh: MapMesh) -> Clusters:
            return levels.LevelClusters(mesh, levels.find_levels(geometry), params.tolerance)

        key = ("detail", params.vpl_deviation, params.vpl_size, params.projection)
        return buffers.stand_in(key, lambda: levels.make_mesh(geometry), cluster)
    return None


def report_size(frame: Frame, io: Io, params: MapParams) -> None:
    """Publish the size of the mesh that stands in for the scene, if one does."""
    mesh = choose_meshes(frame, params)[0]
    if mesh is not frame.buffers.map_meshes[0]:
        io.report(STAND_IN_TRIANGLES.name, int(mesh.clusters.sizes.sum()))
        io.report(STAND_IN_BYTES.name, mesh.mesh_bytes)
