"""A scene on the GPU: vertices, faces and materials, uploaded once; moving models are updated."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from deferred_ir.base.arrays import Array, Ints
from deferred_ir.frame.uploads.cluster_buffers import ClusterBuffers
from deferred_ir.frame.uploads.coverage import list_cut_faces, make_cut_mesh, pack_coverage, place_corners
from deferred_ir.frame.uploads.material_records import describe_materials, pack_materials
from deferred_ir.frame.uploads.scene_textures import SceneTextures
from deferred_ir.gl.context import Gpu
from deferred_ir.gl.shaders import Program
from deferred_ir.meshes.clusters import Clusters
from deferred_ir.meshes.posed import MapMesh, PosedMesh
from deferred_ir.scene.geometry import Geometry
from deferred_ir.scene.scene import Scene
from deferred_ir.scene.surfaces.materials import SLOTS

FACES = 0
"""Binding of the storage buffer of faces; lib/surface/surface.glsl declares it, and those of materials."""
FIRST_UNIT = 15
"""Texture unit of the first slot of materials, further ones below; inputs of passes count up from 0."""
OWN = "own"
"""Key of the scene's own clusters, among those of stand-in meshes."""


class SceneBuffers:
    """Indexed triangles, and what shaders read of each face.

    is_smooth: whether shading normals may differ from the faces'. defines: tell shaders what there is of attributes,
    materials and textures, so that they have no code for the rest.
    general: add neutral normals and texture coordinates where the scene has none, so that its shaders fit any scene.
    """

    def __init__(self, gpu: Gpu, scene: Scene, *, general: bool = False) -> None:
        self.gpu, g = gpu, scene.geometry
        self._geometry, self._poses = g, g.poses.copy()
        self._scene = scene
        self._textures = SceneTextures(gpu, scene.materials, scene.textures)
        uvs = g.uvs if scene.textures else None
        arrays = {"position": g.positions, "normal": g.normals, "color": g.colors, "uv": uvs}
        arrays |= {"second_uv": g.second_uvs, "tangent": g.tangents}
        if general:
            count = len(g.positions)
            # No normal: the face's counts. Without a texture nothing is looked up at `uv`. There is no such colour: an
            # interpolated 1 is not quite 1.
            neutral = {"normal": np.zeros((count, 3)), "uv": np.zeros((count, 2))}
            arrays |= {name: array for name, array in neutral.items() if arrays[name] is None}
        self._runs = _find_runs(scene, self._textures.arrays)
        self.is_smooth = g.is_smooth or general
        self.defines = {
            "HAS_NORMALS": int(arrays["normal"] is not None),
            "HAS_UVS": int(arrays["uv"] is not None),
            "HAS_COLORS": int(arrays["color"] is not None),
            "HAS_TANGENTS": int(g.tangents is not None),
            "HAS_SECOND_UVS": int(g.second_uvs is not None),
            "ONE_MATERIAL": int(len(scene.materials) == 1 and not general),
            "ALL_TEXTURED": int(bool((self._textures.arrays[0] >= 0).all()) and not general),
            **describe_materials(scene),
        }
        ctx = gpu.ctx
        self._attributes = {
            name: (ctx.buffer(np.ascontiguousarray(array, "f4").tobytes()), f"{array.shape[1]}f")
            for name, array in arrays.items()
            if array is not None
        }
        self._indices = ctx.buffer(np.ascontiguousarray(g.faces, "u4").tobytes())
        faces = _pack_faces(g, slice(None))
        self._faces = ctx.buffer(faces.tobytes())
        self._materials = {
            binding: ctx.buffer(table.tobytes())
            for binding, table in (
                pack_materials(scene, self._textures.layers, self._textures.arrays) | pack_coverage(scene)
            ).items()
        }
        gpu.gl.check(f"scene '{scene.name}' with {len(g.faces)} triangles")
        self.face_count = len(g.faces)
        buffers = [buffer for buffer, _ in self._attributes.values()]
        self._buffers = [*buffers, self._indices, self._faces, *self._materials.values()]
        self._clustered: dict[Hashable, ClusterBuffers] = {}

    @property
    def texture_bytes(self) -> int:
        """Bytes of all textures."""
        return self._textures.nbytes

    @property
    def buffer_bytes(self) -> int:
        """Bytes of all buffers, including those of clusters once they exist."""
        return sum(buffer.size for buffer in self._buffers) + sum(mesh.nbytes for mesh in self._clustered.values())

    @property
    def owners(self) -> list[Any]:
        """Keys under which programs hold vertex arrays for this scene."""
        return [self, *self._clustered.values()]

    @cached_property
    def _own(self) -> PosedMesh:
        mesh = MapMesh.from_geometry(self._geometry)
        return mesh.pose(mesh.make_clusters(), self._geometry.poses)

    @property
    def clusters(self) -> Clusters:
        """The scene's triangles in clusters, on the CPU."""
        return self._own.clusters

    @property
    def cluster_buffers(self) -> ClusterBuffers:
        """The scene's triangles in clusters, made when first asked for."""
        if OWN not in self._clustered:
            self._clustered[OWN] = ClusterBuffers(self.gpu, self._own, self._attributes["position"][0])
        return self._clustered[OWN]

    @property
    def map_meshes(self) -> list[ClusterBuffers]:
        """What maps draw: the scene's triangles, or those that are whole and those that have holes."""
        if not len(self._cut_faces):
            return [self.cluster_buffers]
        return [*self._whole_mesh, self.cut_mesh]

    @cached_property
    def _cut_faces(self) -> Ints:
        return list_cut_faces(self._scene)

    @cached_property
    def whole_geometry(self) -> Geometry | None:
        """The triangles that have no holes, at rest; None if all have."""
        rest = self._scene.geometry.rest
        if not len(self._cut_faces):
            return rest
        whole = np.delete(np.arange(len(rest.faces)), self._cut_faces)
        kept = replace(rest, faces=rest.faces[whole], face_materials=rest.face_materials[whole])
        return kept if len(whole) else None

    @property
    def _whole_mesh(self) -> list[ClusterBuffers]:
        geometry = self.whole_geometry
        return [] if geometry is None else [self.stand_in("whole", lambda: MapMesh.from_geometry(geometry))]

    @property
    def cut_mesh(self) -> ClusterBuffers:
        """The triangles that have holes, which there are."""
        faces = self._cut_faces
        return self.stand_in(
            "cut",
            lambda: make_cut_mesh(self._scene.geometry, faces),
            corners=lambda: place_corners(self._scene, faces),
        )

    def stand_in(
        self,
        key: Hashable,
        make: Callable[[], MapMesh],
        cluster: Callable[[MapMesh], Clusters] = MapMesh.make_clusters,
        corners: Callable[[], Array] | None = None,
    ) -> ClusterBuffers:
        """Return another mesh to draw instead of the scene, in clusters, which is cached by `key` as long as the scene.

        make: builds it, with as many moving models as the scene; cluster: groups its triangles; corners: returns what
        programs read as `cut_corner`, (V, 3). They are called once.
        """
        if key not in self._clustered:
            mesh, poses = make(), self._geometry.poses
            held = None if corners is None else self.gpu.ctx.buffer(np.ascontiguousarray(corners(), "f4").tobytes())
            self._buffers += [] if held is None else [held]
            self._buffers.append(self.gpu.ctx.buffer(np.ascontiguousarray(mesh.positions, "f4").tobytes()))
            made = ClusterBuffers(self.gpu, mesh.pose(cluster(mesh), poses), self._buffers[-1], held)
            for number, pose in enumerate(poses):
                made.move(number, pose)
            self._clustered[key] = made
        return self._clustered[key]

    def move(self, geometry: Geometry) -> None:
        """Move models to where `geometry`, which has the same rest, has them; nothing else is uploaded."""
        self._geometry = geometry
        for number in np.flatnonzero((geometry.poses != self._poses).any(axis=(1, 2))).tolist():
            self._poses[number] = np.nan  # until all is uploaded: a move that fails midway is repeated
            vertices = geometry.moving[number].vertices
            moved = {"position": geometry.positions, "normal": geometry.normals, "tangent": geometry.tangents}
            for name, array in moved.items():
                if array is not None:
                    part = np.ascontiguousarray(array[vertices], "f4")
                    self._attributes[name][0].write(
                        part.tobytes(), offset=part.itemsize * part.shape[1] * vertices.start
                    )
            for faces in _group_runs(geometry.faces_of_models[number]):
                self._faces.write(_pack_faces(geometry, faces).tobytes(), offset=16 * faces.start)
            if "_own" in self.__dict__:
                self._own.move(number, geometry.poses[number])
            for mesh in (mesh for key, mesh in self._clustered.items() if key != OWN):
                mesh.move(number, geometry.poses[number])
            self._poses[number] = geometry.poses[number]

    def bind(self) -> None:
        """Bind faces and materials for shaders."""
        self._faces.bind_to_storage_buffer(FACES)
        for binding, table in self._materials.items():
            table.bind_to_storage_buffer(binding)

    def draw(self, program: Program, instances: int = 1, mipmaps: str = "auto") -> None:
        """Draw all triangles in one call, or in one for each set of texture arrays if the program samples textures.

        mipmaps: see SceneTextures.bind.
        """
        array = program.arrays.get(self)
        if array is None:
            attributes = [(*self._attributes[name], name) for name in program.attributes]
            array = self.gpu.ctx.vertex_array(program.glsl, attributes, self._indices, index_element_size=4)
            program.arrays[self] = array
        read = [slot for slot, name in enumerate(SLOTS) if f"{name}_texture" in program.samplers]
        if not read:
            if program.has("first_face"):
                program.set(first_face=0)
            array.render(self.gpu.ctx.TRIANGLES, instances=instances)
            return
        for run in self._runs:
            for slot in read:
                if run.arrays[slot] >= 0:
                    self._textures.bind(FIRST_UNIT - slot, run.arrays[slot], mipmaps)
            program.set(first_face=run.first)
            vertices, first = 3 * run.count, 3 * run.first
            array.render(self.gpu.ctx.TRIANGLES, vertices=vertices, first=first, instances=instances)

    def release(self) -> None:
        """Delete all buffers and textures. Vertex arrays that programs hold for this scene must go first."""
        for mesh in self._clustered.values():
            mesh.release()
        for buffer in self._buffers:
            buffer.release()
        self._textures.release()


def _pack_faces(geometry: Geometry, faces: slice) -> Array:
    """Pack faces for lib/surface/surface.glsl: normal and number of the material, float32 (n, 4)."""
    return np.column_stack([geometry.face_normals[faces], geometry.face_materials[faces]]).astype("f4")


def _group_runs(numbers: Ints) -> list[slice]:
    """Group ascending numbers (n,) into ranges without gaps."""
    parts = np.split(numbers, np.flatnonzero(np.diff(numbers) != 1) + 1)
    return [slice(int(part[0]), int(part[-1]) + 1) for part in parts if len(part)]


@dataclass(frozen=True)
class _Run:
    """Faces first, first + 1, ... whose materials' textures are in the same arrays, one for each slot, -1 for none."""

    arrays: tuple[int, ...]
    first: int
    count: int


def _find_runs(scene: Scene, arrays: Ints) -> list[_Run]:
    """Return the runs of faces with the same `arrays` (slots, materials); loading sorts faces by these."""
    of_material = np.unique(arrays.T, axis=0, return_inverse=True)[1].reshape(-1)
    of_face = of_material[scene.geometry.face_materials]
    starts = np.flatnonzero(np.diff(of_face, prepend=of_face[0] - 1))
    ends = np.append(starts[1:], len(of_face))
    first = scene.geometry.face_materials[starts]
    return [
        _Run(tuple(arrays[:, material].tolist()), int(start), int(end - start))
        for material, start, end in zip(first, starts, ends, strict=True)
    ]
