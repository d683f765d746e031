"""A scene: triangles, materials, a camera and lights. `load` makes one from files.

All arrays are world space. Nothing here touches OpenGL.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import isfinite
from pathlib import Path
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from deferred_ir.base.errors import SceneError, SettingError
from deferred_ir.scene.camera import Camera, find_view_fault
from deferred_ir.scene.geometry import Geometry, Model
from deferred_ir.scene.lights.base import Bounds, DirectLight, Light, SampledLight, is_direct, is_sampled
from deferred_ir.scene.lights.environment import Environment
from deferred_ir.scene.lights.fields import LightError
from deferred_ir.scene.lights.spotlight import Spotlight
from deferred_ir.scene.surface_light import SurfaceLight, find_surface_light
from deferred_ir.scene.surfaces.materials import Material, Texture


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
    """A loaded scene.

    lights: all but emitting surfaces, which materials say. chosen: what the loader chose for lack of it in the files;
    notes: what it does not honour.
    """

    name: str
    path: Path
    geometry: Geometry
    materials: tuple[Material, ...]
    textures: tuple[Texture, ...]
    models: tuple[Model, ...]
    camera: Camera
    lights: tuple[Light, ...]
    render: RenderDefaults = RenderDefaults()
    chosen: Mapping[str, Any] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    @cached_property
    def hash(self) -> str:
        """First 16 hex digits of SHA-256 over everything that a picture depends on."""
        import hashlib

        digest = hashlib.sha256()
        g = self.geometry
        for array in (g.positions, g.faces, g.face_materials, g.normals, g.uvs, g.colors, g.second_uvs, g.tangents):
            digest.update(b"-" if array is None else np.ascontiguousarray(array).tobytes())
        for texture in self.textures:
            digest.update(repr(texture.pixels.shape).encode() + np.ascontiguousarray(texture.pixels).tobytes())
        motions = tuple(model.motion for model in self.models)
        digest.update(repr((self.materials, self.camera, self.lights, motions)).encode())
        return digest.hexdigest()[:16]

    @cached_property
    def bounds(self) -> Bounds:
        """A sphere about all surfaces wherever models move: what light from infinity enters."""
        low, high = self.geometry.extent
        x, y, z = ((low + high) / 2).tolist()
        return Bounds((x, y, z), self.geometry.diagonal / 2)

    @property
    def emitters(self) -> tuple[Light, ...]:
        """Everything that shines: the lights that are on, then emitting surfaces as one light."""
        surfaces = self.surface_light
        return (*(light for light in self.lights if any(light.emission)), *([surfaces] if surfaces else []))

    @property
    def direct_lights(self) -> tuple[DirectLight, ...]:
        """The lights that shaders evaluate, on or off."""
        return tuple(light for light in self.lights if is_direct(light))

    @property
    def sampled_lights(self) -> tuple[SampledLight, ...]:
        """The lights that points stand for, if they are on."""
        return tuple(light for light in self.emitters if is_sampled(light))

    @property
    def environment(self) -> Environment | None:
        """Its first environment, if that is on: what the camera sees behind everything."""
        return next((x for x in self.lights if isinstance(x, Environment) and any(x.emission)), None)

    @property
    def spotlight(self) -> Spotlight:
        """Its first light of that kind, on or off. Raises SceneError if it has none."""
        found = next((light for light in self.lights if isinstance(light, Spotlight)), None)
        if found is None:
            raise SceneError(f"{self.path}: has no spotlight; add [spotlight]")
        return found

    @property
    def surface_light(self) -> SurfaceLight | None:
        """Its emitting surfaces as a light, None if there are none."""
        return _find_surface_light(self.geometry, self.materials, self.textures)

    @cached_property
    def has_gloss(self) -> bool:
        """Whether a surface reflects other than as a Lambertian one."""
        return any(material.is_glossy for material in self.materials)

    @cached_property
    def has_cutouts(self) -> bool:
        """Whether some of a surface may not be there."""
        return any(material.is_cut for material in self.materials)

    @cached_property
    def shows_emission(self) -> bool:
        """Whether surfaces are seen to emit."""
        return any(material.emits for material in self.materials)

    @property
    def emits(self) -> bool:
        """Whether anything shines."""
        return bool(self.emitters)

    @property
    def moves(self) -> bool:
        """Whether camera, a light or a model has a motion."""
        return bool(self.camera.motion or any(light.motion for light in self.lights) or self.geometry.moves)

    def at(self, time: float) -> Scene:
        """Return the scene as it is at `time` seconds, without motion; itself where nothing moves.

        Its geometry is the same object at times between which no model moves. Raises SceneError if camera or spotlight
        stands where it looks at, SettingError if the time is not finite.
        """
        if not isfinite(time):
            raise SettingError(f"time {time}: must be finite, in seconds")
        geometry = self.geometry.at(time)
        if geometry is self.geometry and self.camera.motion is None and not any(light.motion for light in self.lights):
            return self
        camera = self.camera.at(time)
        if fault := find_view_fault(camera.position, camera.look_at, camera.up):
            raise SceneError(f"{self.path}: camera.motion: at {time:g} s {fault[0]} {fault[1]}")
        lights = tuple(self._place(light, number, time) for number, light in enumerate(self.lights))
        return replace(self, geometry=geometry, camera=replace(camera, motion=None), lights=lights)

    def _place(self, light: Light, number: int, time: float) -> Light:
        """Return light `number` where it is at `time`. Raises SceneError if it looks nowhere there."""
        try:
            return light.at(time)
        except LightError as error:
            key, what = error.faults[0]
            name = light.kind if light.kind == "spotlight" else f"light {number}"
            raise SceneError(f"{self.path}: {name}.motion: at {time:g} s {key} {what}") from error


_surface_lights: WeakKeyDictionary[Geometry, tuple[Any, SurfaceLight | None]] = WeakKeyDictionary()
"""By geometry, with the materials and textures that they were made from."""


def _find_surface_light(
    geometry: Geometry, materials: tuple[Material, ...], textures: tuple[Texture, ...]
) -> SurfaceLight | None:
    """Return the emitting surfaces as a light; the same object for the same scene."""
    if not any(material.emits and not material.unlit for material in materials):
        return None
    made_from, found = _surface_lights.get(geometry, (None, None))
    if made_from != (materials, textures):
        found = find_surface_light(geometry, materials, textures)
        _surface_lights[geometry] = (materials, textures), found
    return found
