"""A scene on the GPU: vertices, faces, materials and textures, uploaded once; moving models are updated."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from deferred_ir.base.arrays import Array, Ints
from deferred_ir.base.colour import srgb_table
from deferred_ir.base.errors import DeviceError
from deferred_ir.frame.cluster_buffers import ClusterBuffers
from deferred_ir.gl.context import Gpu
from deferred_ir.gl.shaders import Program
from deferred_ir.gl.textures import GpuTexture
from deferred_ir.graph.ports import Texture
from deferred_ir.meshes.clusters import Clusters
from deferred_ir.meshes.posed import MapMesh, PosedMesh
from deferred_ir.scene.geometry import Geometry
from deferred_ir.scene.scene import Scene

FACES, MATERIALS, EMISSIONS = 0, 1, 2
"""Bindings of the storage buffers that lib/surface/surface.glsl declares."""
ALBEDO_TEXTURE, EMISSION_TEXTURE = 15, 14
"""Texture units of `albedo_texture` and `emission_texture`; inputs of passes count up from 0, and GL promises 16."""
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
        uvs = g.uvs if scene.textures else None
        arrays = {"position": g.positions, "normal": g.normals, "color": g.colors, "uv": uvs}
        if general:
            count = len(g.positions)
            # No normal: the face's counts. Without a texture nothing is looked up at `uv`. There is no such colour: an
            # interpolated 1 is not quite 1.
            neutral = {"normal": np.zeros((count, 3)), "uv": np.zeros((count, 2))}
            arrays |= {name: array for name, array in neutral.items() if arrays[name] is None}
        self._runs = _find_runs(scene)
        self.is_smooth = g.is_smooth or general
        self.defines = {
            "HAS_NORMALS": int(arrays["normal"] is not None),
            "HAS_UVS": int(arrays["uv"] is not None),
            "HAS_COLORS": int(arrays["color"] is not None),
            "ONE_MATERIAL": int(len(scene.materials) == 1 and not general),
            "ALL_TEXTURED": int(all(run.texture is not None for run in self._runs) and not general),
            "EMITS": int(scene.shows_emission),
        }
        ctx = gpu.ctx
        self._attributes = {
            name: (ctx.buffer(np.ascontiguousarray(array, "f4").tobytes()), f"{array.shape[1]}f")
            for name, array in arrays.items()
            if array is not None
        }
        self._indices = ctx.buffer(np.ascontiguousarray(g.faces, "u4").tobytes())
        faces = _pack_faces(g, slice(None))
        materials = np.array([(*material.base_color, 0) for material in scene.materials], "f4")
        self._faces, self._materials = ctx.buffer(faces.tobytes()), ctx.buffer(materials.tobytes())
        gpu.gl.check(f"scene '{scene.name}' with {len(g.faces)} triangles")
        self._textures = [self._upload(texture) for texture in scene.textures]
        self.face_count = len(g.faces)
        buffers = [*(buffer for buffer, _ in self._attributes.values()), self._indices, self._faces, self._materials]
        self._emissions = None
        if scene.shows_emission:
            emissions = [(*material.emission, material.emits_both_sides) for material in scene.materials]
            self._emissions = ctx.buffer(np.array(emissions, "f4").tobytes())
            buffers.append(self._emissions)
        self._buffers = buffers
        self._clustered: dict[Hashable, ClusterBuffers] = {}
        self.texture_bytes = sum(texture.nbytes for texture in self._textures)

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

    def stand_in(
        self, key: Hashable, make: Callable[[], MapMesh], cluster: Callable[[MapMesh], Clusters] = MapMesh.make_clusters
    ) -> ClusterBuffers:
        """Return another mesh to draw instead of the scene, in clusters, which is cached by `key` as long as the scene.

        make: builds it, with as many moving models as the scene; cluster: groups its triangles. Both are called once.
        """
        if key not in self._clustered:
            mesh, poses = make(), self._geometry.poses
            self._buffers.append(self.gpu.ctx.buffer(np.ascontiguousarray(mesh.positions, "f4").tobytes()))
            made = ClusterBuffers(self.gpu, mesh.pose(cluster(mesh), poses), self._buffers[-1])
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
            for name, array in (("position", geometry.positions), ("normal", geometry.normals)):
                if array is not None:
                    part = np.ascontiguousarray(array[vertices], "f4")
                    self._attributes[name][0].write(part.tobytes(), offset=12 * vertices.start)
            for faces in _group_runs(geometry.faces_of_models[number]):
                self._faces.write(_pack_faces(geometry, faces).tobytes(), offset=16 * faces.start)
            if "_own" in self.__dict__:
                self._own.move(number, geometry.poses[number])
            for mesh in (mesh for key, mesh in self._clustered.items() if key != OWN):
                mesh.move(number, geometry.poses[number])
            self._poses[number] = geometry.poses[number]

    def _upload(self, texture: Any) -> GpuTexture:
        height, width = texture.pixels.shape[:2]
        if max(width, height) > self.gpu.max_size:
            raise DeviceError(
                f"{texture.name}: {width}x{height} pixels, and this driver takes at most {self.gpu.max_size}; "
                "scale the image down"
            )
        # Decoded here, into half floats: drivers may approximate sRGB (llvmpipe is 2 % off in dark texels), and rays
        # must fetch what the rasteriser shows.
        linear = np.ones((height, width, 4), np.float32)
        linear[..., :3] = srgb_table().astype(np.float16)[texture.pixels[..., :3]]
        result = GpuTexture(self.gpu, Texture("rgba16f", (width, height)), (width, height))
        result.upload(linear[::-1])
        return result

    def bind(self) -> None:
        """Bind faces and materials for shaders."""
        self._faces.bind_to_storage_buffer(FACES)
        self._materials.bind_to_storage_buffer(MATERIALS)
        if self._emissions:
            self._emissions.bind_to_storage_buffer(EMISSIONS)

    def draw(self, program: Program, instances: int = 1) -> None:
        """Draw all triangles in one call, or in one for each texture if the program samples textures."""
        array = program.arrays.get(self)
        if array is None:
            attributes = [(*self._attributes[name], name) for name in program.attributes]
            array = self.gpu.ctx.vertex_array(program.glsl, attributes, self._indices, index_element_size=4)
            program.arrays[self] = array
        if not program.samplers & {"albedo_texture", "emission_texture"}:
            if program.has("first_face"):
                program.set(first_face=0)
            array.render(self.gpu.ctx.TRIANGLES, instances=instances)
            return
        for run in self._runs:
            if run.texture is not None:
                self._textures[run.texture].bind(ALBEDO_TEXTURE, self.gpu.sampler(linear=True, repeat=True))
            if "emission_texture" in program.samplers:
                if run.emission is not None:
                    self._textures[run.emission].bind(EMISSION_TEXTURE, self.gpu.sampler(linear=True, repeat=True))
                program.set(emission_textured=run.emission is not None)
            program.set(textured=run.texture is not None, first_face=run.first)
            vertices, first = 3 * run.count, 3 * run.first
            array.render(self.gpu.ctx.TRIANGLES, vertices=vertices, first=first, instances=instances)

    def release(self) -> None:
        """Delete all buffers and textures. Vertex arrays that programs hold for this scene must go first."""
        for mesh in self._clustered.values():
            mesh.release()
        for buffer in self._buffers:
            buffer.release()
        for texture in self._textures:
            texture.release()


def _pack_faces(geometry: Geometry, faces: slice) -> Array:
    """Pack faces for lib/surface/surface.glsl: normal and number of the material, float32 (n, 4)."""
    return np.column_stack([geometry.face_normals[faces], geometry.face_materials[faces]]).astype("f4")


def _group_runs(numbers: Ints) -> list[slice]:
    """Group ascending numbers (n,) into ranges without gaps."""
    parts = np.split(numbers, np.flatnonzero(np.diff(numbers) != 1) + 1)
    return [slice(int(part[0]), int(part[-1]) + 1) for part in parts if len(part)]


@dataclass(frozen=True)
class _Run:
    """Faces first, first + 1, ... with one texture of reflectance and one of emission, if any."""

    texture: int | None
    emission: int | None
    first: int
    count: int


def _find_runs(scene: Scene) -> list[_Run]:
    """Return the runs of faces with the same textures; loading sorts faces by these."""
    textures = [
        tuple(None if texture is None else texture.number for texture in (m.base_color_texture, m.emission_texture))
        for m in scene.materials
    ]
    kinds = {pair: number for number, pair in enumerate(dict.fromkeys(textures))}
    of_face = np.array([kinds[pair] for pair in textures])[scene.geometry.face_materials]
    starts = np.flatnonzero(np.diff(of_face, prepend=of_face[0] - 1))
    ends = np.append(starts[1:], len(of_face))
    pairs = list(kinds)
    found = [(*pairs[of_face[start]], int(start), int(end - start)) for start, end in zip(starts, ends, strict=True)]
    return [_Run(texture, emission, first, count) for texture, emission, first, count in found]
