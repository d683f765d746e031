"""A scene: triangles, materials, a camera and one spotlight. `load` makes one from files.

All arrays are world space. Nothing here touches OpenGL.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np

from deferred_ir.base.errors import SceneError, SettingError
from deferred_ir.scene.camera import Camera, find_view_fault
from deferred_ir.scene.geometry import Geometry, Model
from deferred_ir.scene.lights.base import Light
from deferred_ir.scene.lights.spot import Spotlight


@dataclass(frozen=True, eq=False)
class Texture:
    """An image texture. pixels: uint8 (H, W, 3), sRGB, top row first; v = 1 is the top edge; repeated in u and v."""

    name: str
    pixels: Any


@dataclass(frozen=True)
class Material:
    """A Lambertian material: reflectance is albedo (linear RGB) times texture (index into Scene.textures), if any."""

    name: str
    albedo: tuple[float, float, float]
    texture: int | None = None


@dataclass(frozen=True)
class RenderDefaults:
    """Defaults of the command line, from a scene file's [render] table."""

    graph: str | None = None
    size: tuple[int, int] | None = None
    vpls: int | None = None
    seed: int | None = None
    set: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Scene:
    """A loaded scene. chosen: what the loader chose for lack of it in the files; notes: what it does not honour."""

    name: str
    path: Path
    geometry: Geometry
    materials: tuple[Material, ...]
    textures: tuple[Texture, ...]
    models: tuple[Model, ...]
    camera: Camera
    spotlight: Spotlight
    render: RenderDefaults = RenderDefaults()
    chosen: Mapping[str, Any] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    @cached_property
    def hash(self) -> str:
        """First 16 hex digits of SHA-256 over everything that a picture depends on."""
        import hashlib

        digest = hashlib.sha256()
        g = self.geometry
        for array in (g.positions, g.faces, g.face_materials, g.normals, g.uvs, g.colors):
            digest.update(b"-" if array is None else np.ascontiguousarray(array).tobytes())
        for texture in self.textures:
            digest.update(repr(texture.pixels.shape).encode() + np.ascontiguousarray(texture.pixels).tobytes())
        motions = tuple(model.motion for model in self.models)
        digest.update(repr((self.materials, self.camera, self.spotlight, motions)).encode())
        return digest.hexdigest()[:16]

    @property
    def lights(self) -> tuple[Light, ...]:
        """All direct lights."""
        return (self.spotlight,)

    @property
    def emits(self) -> bool:
        """Whether a light shines."""
        return any(any(light.emission) for light in self.lights)

    @property
    def moves(self) -> bool:
        """Whether camera, spotlight or a model has a motion."""
        return bool(self.camera.motion or self.spotlight.motion or self.geometry.moves)

    def at(self, time: float) -> Scene:
        """Return the scene as it is at `time` seconds, without motion; itself where nothing moves.

        Its geometry is the same object at times between which no model moves. Raises SceneError if camera or spotlight
        stands where it looks at, SettingError if the time is not finite.
        """
        if not isfinite(time):
            raise SettingError(f"time {time}: must be finite, in seconds")
        geometry = self.geometry.at(time)
        if geometry is self.geometry and self.camera.motion is None and self.spotlight.motion is None:
            return self
        camera, light = self.camera.at(time), self.spotlight.at(time)
        views = {
            "camera": find_view_fault(camera.position, camera.look_at, camera.up),
            "spotlight": find_view_fault(light.position, light.look_at),
        }
        for name, fault in views.items():
            if fault:
                raise SceneError(f"{self.path}: {name}.motion: at {time:g} s {fault[0]} {fault[1]}")
        return replace(
            self, geometry=geometry, camera=replace(camera, motion=None), spotlight=replace(light, motion=None)
        )
