"""Clusters of triangles on the GPU. One indirect call draws each cluster once for every light that may see it."""

from __future__ import annotations

from typing import Any

import numpy as np

from deferred_ir.base.arrays import Array, Bools, Ints
from deferred_ir.gl.context import Gpu
from deferred_ir.gl.shaders import Program
from deferred_ir.meshes.posed import PosedMesh

COMMAND = np.dtype([(name, "u4") for name in ("count", "instances", "first_index", "base_vertex", "base_instance")])
"""A command of glMultiDrawElementsIndirect."""


class ClusterBuffers:
    """Indices of a mesh's faces in the order of its clusters, and the commands of the draw calls.

    positions: the buffer of vertices, three floats each; corners: that of what programs read as `cut_corner`, three
    floats, if the mesh has holes. The caller owns both.
    """

    def __init__(self, gpu: Gpu, posed: PosedMesh, positions: Any, corners: Any = None) -> None:
        self.gpu, self.posed, self._positions, self._corners = gpu, posed, positions, corners
        self.clusters = clusters = posed.clusters
        faces = posed.mesh.faces
        self._indices = gpu.ctx.buffer(np.ascontiguousarray(faces[clusters.order], "u4").tobytes())
        self._lights = gpu.ctx.buffer(reserve=4, dynamic=True)
        self._commands = gpu.ctx.buffer(reserve=len(clusters) * COMMAND.itemsize, dynamic=True)
        self._each = np.zeros(len(clusters), COMMAND)
        self._each["count"], self._each["first_index"] = 3 * clusters.sizes, 3 * clusters.starts[:-1]
        gpu.gl.check(f"clusters of {len(faces)} triangles")

    @property
    def defines(self) -> dict[str, int]:
        """Defines of programs that draw it: CUT, whether it has holes."""
        return {"CUT": int(self._corners is not None)}

    @property
    def nbytes(self) -> int:
        """Size of all buffers."""
        return sum(buffer.size for buffer in (self._indices, self._lights, self._commands))

    @property
    def mesh_bytes(self) -> int:
        """Size of vertices and indices alone."""
        size: int = self._positions.size + self._indices.size
        return size

    def move(self, number: int, pose: Array) -> None:
        """Move model `number` to `pose` (4, 4), relative to its rest: its clusters and its vertices."""
        first, points = self.posed.move(number, pose)
        self._positions.write(points.tobytes(), offset=12 * first)

    def draw_all(self, program: Program, light: np.ndarray) -> None:
        """Draw all clusters for one light, LIGHT records (1,). The program reads `position` alone."""
        commands = self._each[self.clusters.find_drawn(light)[0]]
        commands["instances"] = 1
        self._commands.write(commands.tobytes())
        self._array(program).render_indirect(self._commands, self.gpu.ctx.TRIANGLES, count=len(commands))

    def draw(self, program: Program, visible: Bools, lights: Ints, patches: bool = False) -> None:
        """Draw cluster c for light lights[l] of the bound block wherever visible[l, c], bool (lights, clusters).

        The program reads `position` and `view_index`.
        """
        pairs = np.ascontiguousarray(visible.T)
        light = np.broadcast_to(lights.astype("i4"), pairs.shape)[pairs]
        instances = np.count_nonzero(pairs, axis=1)
        commands = self._each.copy()
        commands["instances"], commands["base_instance"] = instances, np.cumsum(instances) - instances
        commands = commands[instances > 0]
        if not len(commands):
            return
        if 4 * len(light) > self._lights.size:
            self._lights.orphan(4 * len(light))
            self.gpu.gl.check(f"drawing {len(light)} clusters")
        self._lights.write(light.tobytes())
        self._commands.write(commands.tobytes())
        if patches:
            self.gpu.ctx.patch_vertices = 3
        mode = self.gpu.ctx.PATCHES if patches else self.gpu.ctx.TRIANGLES
        self._array(program).render_indirect(self._commands, mode, count=len(commands))

    def _array(self, program: Program) -> Any:
        """Return the vertex array with what `program` reads."""
        if self not in program.arrays:
            # An instanced attribute counts from base_instance; gl_InstanceID does not.
            known = [(self._positions, "3f", "position"), (self._lights, "1i/i", "view_index")]
            known += [(self._corners, "3f", "cut_corner")] if self._corners else []
            attributes = [attribute for attribute in known if attribute[2] in program.attributes]
            program.arrays[self] = self.gpu.ctx.vertex_array(
                program.glsl, attributes, self._indices, index_element_size=4
            )
        return program.arrays[self]

    def release(self) -> None:
        """Delete the buffers. Vertex arrays that programs hold for them must go first."""
        for buffer in (self._indices, self._lights, self._commands):
            buffer.release()
