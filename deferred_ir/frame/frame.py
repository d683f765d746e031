"""One frame in time: what passes know of it, and the uniform block in which shaders read it."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from deferred_ir.base.arrays import Vec3
from deferred_ir.frame.direct_lights import DescribedViews, describe_views
from deferred_ir.frame.light_culling import SeenClusters, find_seen_clusters
from deferred_ir.frame.uploads.scene_buffers import SceneBuffers
from deferred_ir.gl.textures import GpuTexture
from deferred_ir.rays.pixel_surfaces import Surfaces, decode_gbuffer, decode_samples
from deferred_ir.rays.tracer import Tracer
from deferred_ir.scene.scene import Scene

NEAR = 1e-8
"""Near planes of camera and lights, as a fraction of the scene's scale: what is nearer is cut away.

Walls so close to a light that they are cut let light through. A light's own surface, which roundings put a little
before or behind it, is kept out of its map by lifting the light off instead (frame/vpl_buffer.lift_off_surface,
shadows/views.py). Depths, near / distance in 32-bit floats, have the same relative precision whatever the
near plane.
"""

FRAME = np.dtype(
    [
        ("camera", "f4", 3),
        ("near", "f4"),  # near plane of the camera and of all lights
        ("ray", "f4", (3, 4)),  # a, b, c of Camera.ray_axes: a point at view depth 1 is camera + a x + b y + c
        ("clip", "f4", (3, 4)),  # rows that take a point relative to the camera to clip x, clip y and view depth
    ]
)
"""Written to uniform block 0; shaders/lib/camera/frame.glsl declares the same."""


@dataclass(frozen=True, eq=False)
class Frame:
    """What a pass may know of a frame. scene: with camera and light at `time` [s]. buffers: the scene on the GPU.

    reuse: results of the last frame may be used again where they would come out the same.
    keep_all: nothing may be left out that another scene or view would need.
    """

    size: tuple[int, int]
    scene: Scene
    buffers: SceneBuffers
    tracer: Callable[[], Tracer]
    seed: int = 0
    time: float = 0.0
    reuse: bool = False
    keep_all: bool = False
    _surfaces: dict[tuple[GpuTexture, GpuTexture], Surfaces] = field(default_factory=dict, init=False)

    def read_parts(self, names: Collection[str] | None) -> tuple[Any, ...]:
        """Return the values of the PARTS with these names, of all for None; equal ones make equal outputs."""
        return tuple(read(self) for name, read in PARTS.items() if names is None or name in names)

    @property
    def by_view(self) -> bool:
        """Whether passes may leave out what this view does not need, because the next frame will not reuse it."""
        return not (self.reuse or self.keep_all)

    @property
    def smooth(self) -> bool:
        """Whether shading normals may differ from the faces'."""
        return self.buffers.is_smooth

    @property
    def near(self) -> float:
        """Near plane of the camera and of all lights, in world units."""
        return NEAR * self.scene.geometry.scale

    @cached_property
    def light_views(self) -> DescribedViews:
        """The views of the scene's direct lights."""
        return describe_views(self.scene)

    @cached_property
    def seen_clusters(self) -> SeenClusters:
        """The clusters of triangles that the camera may see."""
        return find_seen_clusters(self.buffers.clusters, self.scene.camera, self.size)

    def read_surfaces(self, depth: GpuTexture, normals: GpuTexture) -> Surfaces:
        """Return the surfaces that the pixels of a G-buffer show, read back once, after both textures were written."""
        key = depth, normals
        if key not in self._surfaces:
            smooth = self.scene.geometry.is_smooth
            self._surfaces[key] = decode_gbuffer(
                self.scene.camera, self.near, depth.read()[..., 0], normals.read(), smooth=smooth
            )
        return self._surfaces[key]

    def read_samples(self, positions: GpuTexture, normals: GpuTexture) -> Surfaces:
        """Return the surfaces of samples, numbered by their texels, read back once, after both textures were written.

        positions: with the depth of view, 0 where nothing was seen. normals: as in the G-buffer.
        """
        key = positions, normals
        if key not in self._surfaces:
            smooth = self.scene.geometry.is_smooth
            self._surfaces[key] = decode_samples(positions.read(), normals.read(), smooth=smooth)
        return self._surfaces[key]

    def pack(self) -> bytes:
        """Return the FRAME record."""
        record = np.zeros((), FRAME)
        camera = self.scene.camera
        rays = camera.ray_axes(self.size)
        position: Vec3 = camera.position
        record["camera"], record["near"] = position, self.near
        record["ray"][:, :3] = rays
        # Axes are orthogonal, so dividing by the squared length inverts them; forward has length 1.
        record["clip"][:, :3] = rays / (rays**2).sum(axis=1, keepdims=True)
        return record.tobytes()


def describe_environment(scene: Scene) -> dict[str, Any]:
    """Return the uniforms of shaders/lib/lights/environment.glsl."""
    light = scene.environment
    angle = math.radians(light.rotation) if light else 0.0
    emission = light.emission if light else (0.0, 0.0, 0.0)
    return {"environment_emission": emission, "environment_turn": (math.cos(angle), math.sin(angle))}


PARTS: Mapping[str, Callable[[Frame], Any]] = {
    "camera": lambda frame: (frame.scene.camera, frame.size),
    "light": lambda frame: frame.scene.lights,
    "models": lambda frame: (
        frame.buffers,
        frame.scene.geometry,
        frame.scene.materials,
        frame.scene.textures,
    ),
    "seed": lambda frame: frame.seed,
    "time": lambda frame: frame.time,
}
"""The parts of a frame that a pass can name in `depends`, and how to read what each holds."""
