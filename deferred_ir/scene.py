"""What a scene is: triangles, materials, a camera and one spotlight. `load` makes one from files.

All arrays are world space. Nothing here touches OpenGL.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from .camera import Camera, view_fault
from .errors import SceneError
from .graph import Facts
from .lights import Spotlight
from .motion import ModelMotion
from .typing import Array, Ints, Vec3

FAR = 4.0
"""Scenes farther than this many of their diagonals from the origin are moved to it before 32 bits hold them."""

View = TypeVar("View", Camera, Spotlight)


def moved(view: View, by: Vec3) -> View:
    """A camera or a spotlight, at rest, in coordinates that differ by `by`."""
    (x, y, z), (u, v, w), (a, b, c) = view.position, view.look_at, by
    return replace(view, position=(x + a, y + b, z + c), look_at=(u + a, v + b, w + c), motion=None)


@dataclass(frozen=True, eq=False)
class Texture:
    """An image texture. pixels: uint8 (H, W, 3), sRGB, top row first; v = 1 is the top edge; repeated in u and v."""

    name: str
    pixels: Any


@dataclass(frozen=True)
class Material:
    """Lambertian: reflectance = albedo (linear RGB) times the texture (index into Scene.textures), if any."""

    name: str
    albedo: tuple[float, float, float]
    texture: int | None = None


@dataclass(frozen=True)
class Model:
    """One [[model]] of the scene file and its range of vertices.

    Its faces are those that use these vertices; they need not be neighbours, since faces are sorted by texture.
    """

    name: str
    first_vertex: int
    vertex_count: int
    motion: ModelMotion | None = None


@dataclass(frozen=True, eq=False)
class Geometry:
    """All triangles of a scene, indexed.

    positions: float64 (V, 3).
    faces: int32 (F, 3), counter-clockwise from the front.
    face_materials: int32 (F,), index into Scene.materials. Faces are sorted by their material's texture: first those
        without one, then texture 0, 1, ...
    normals: float32 (V, 3) unit shading normals, a zero row where the file has none (the face's normal counts there);
        None if no vertex has one.
    uvs: float32 (V, 2), or None if no material has a texture.
    colors: float32 (V, 3) linear vertex colours that multiply the albedo, or None.
    """

    positions: Array
    faces: Ints
    face_materials: Ints
    normals: Array | None = None
    uvs: Array | None = None
    colors: Array | None = None

    @cached_property
    def face_normals(self) -> Array:
        """Unit geometric normals by winding, float64 (F, 3); +y for a degenerate face, which covers no pixel."""
        a, b, c = (self.positions[self.faces[:, i]] for i in range(3))
        # Edges scaled to about 1 first: the product of two tiny edges must not underflow.
        ab, ac = b - a, c - a
        size = np.maximum(np.abs(ab).max(axis=1), np.abs(ac).max(axis=1))[:, None]
        size[size == 0] = 1
        cross = np.cross(ab / size, ac / size)
        length = np.linalg.norm(cross, axis=1)
        flat = length < 1e-30
        cross[flat], length[flat] = (0, 1, 0), 1
        normals: Array = cross / length[:, None]
        return normals

    @cached_property
    def bounds(self) -> Array:
        """Corners (minimum, maximum) of all vertices that faces use, float64 (2, 3)."""
        used = self.positions[np.unique(self.faces)]
        return np.stack([used.min(axis=0), used.max(axis=0)])

    @cached_property
    def diagonal(self) -> float:
        """Length of the bounding box's diagonal."""
        return float(np.linalg.norm(self.bounds[1] - self.bounds[0]))

    @cached_property
    def centre(self) -> Vec3:
        """Where the origin of 32-bit coordinates lies: the middle of the bounds where they are far off, else 0."""
        middle = self.bounds.mean(axis=0)
        x, y, z = middle.tolist() if np.abs(middle).max() > FAR * self.diagonal else (0.0, 0.0, 0.0)
        return x, y, z

    @cached_property
    def centred(self) -> Geometry:
        """The same with `centre` as its origin, subtracted in 64 bits; itself where that is 0."""
        return replace(self, positions=self.positions - self.centre) if any(self.centre) else self


@dataclass(frozen=True)
class RenderDefaults:
    """The scene file's [render] table: what the command line takes where it says nothing."""

    graph: str | None = None
    size: tuple[int, int] | None = None
    vpls: int | None = None
    seed: int | None = None
    set: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Scene:
    """A loaded scene. `chosen` says what was picked for the user, `notes` what of the files is not honoured."""

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
    def centred(self) -> Scene:
        """The scene as it stands, near the origin: what the GPU and Embree, which hold 32 bits, are given.

        Itself where it is near already (see Geometry.centre). Camera and light rest where they are.
        """
        x, y, z = self.geometry.centre
        if not (x or y or z):
            return self
        by = (-x, -y, -z)
        return replace(
            self,
            geometry=self.geometry.centred,
            camera=moved(self.camera, by),
            spotlight=moved(self.spotlight, by),
        )

    @property
    def facts(self) -> Facts:
        """What planning a frame may know of the scene."""
        return Facts(emits=any(self.spotlight.emission), triangles=len(self.geometry.faces))

    def at(self, time: float) -> Scene:
        """The scene with camera and spotlight at `time` seconds; SceneError if one of them meets what it looks at."""
        if self.camera.motion is None and self.spotlight.motion is None:
            return self
        camera, light = self.camera.at(time), self.spotlight.at(time)
        views = {
            "camera": view_fault(camera.position, camera.look_at, camera.up),
            "spotlight": view_fault(light.position, light.look_at),
        }
        for name, fault in views.items():
            if fault:
                raise SceneError(f"{self.path}: {name}.motion: at {time:g} s {fault[0]} {fault[1]}")
        return replace(self, camera=camera, spotlight=light)
