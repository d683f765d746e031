"""The interface of peers: path tracers that render the same scene for comparison, each in a process of its own.

A peer is a module of this package with `INSTALL` (what pip installs), `available()` and a class `Peer`, a `Renderer`.
Its library is imported in that process only.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from deferred_ir.base.arrays import Array
from deferred_ir.base.colour import linear_from_srgb
from deferred_ir.base.errors import SettingError
from deferred_ir.scene.scene import Scene
from deferred_ir.scene.surfaces.materials import Material, Texture, TextureRef

NAMES = ("mitsuba", "cycles")
"""The modules of this package that are peers, in the order of the tables."""


@dataclass(frozen=True, eq=False)
class Rendered:
    """One image of a peer. radiance: float32 (H, W, 3), top row first, mean over each pixel.

    ms: wall time from the call to a warm renderer, with scene loaded and kernels compiled, until the image is in
    memory.
    """

    radiance: Array
    ms: float


class Renderer(Protocol):
    """A peer with one scene loaded: direct light and `bounces` diffuse bounces, as docs/conventions.md defines them.

    The constructor raises SettingError for a scene that the peer cannot render as that document says.
    """

    about: str
    """Name, version and variant, such as 'Mitsuba 3.9.1, llvm_ad_rgb'."""

    def __init__(self, scene: Scene, size: tuple[int, int], bounces: int) -> None: ...

    def render(self, spp: int, seed: int) -> Rendered:
        """Render with `spp` paths a pixel, and denoise if the peer has a denoiser."""


class Module(Protocol):
    """What a module of a peer offers."""

    INSTALL: str
    Peer: type[Renderer]

    def available(self) -> str | None:
        """Return None if the peer can be used here, else the reason why not."""


def check_materials(name: str, scene: Scene) -> None:
    """Raise SettingError for materials that the peer `name` cannot render as ours are."""
    for material in scene.materials:
        faults = {
            "a normal map": material.normal_texture is not None,
            "holes": material.is_cut,
            "unlit emission": material.unlit and material.emits,
            "images that are moved, mirrored, cut off at their edge or not filtered": any(
                image is not None and not _is_plain(image) for image in material.textures.values()
            ),
        }
        for what, there in faults.items():
            if there:
                raise SettingError(f"{name}: does not render {what}, as '{material.name}' has; leave it out by --peers")


def _is_plain(image: TextureRef) -> bool:
    """Return whether a texture is read at the first coordinates, repeated and filtered."""
    plain, sampler = TextureRef(image.number), image.sampler
    moved = (image.uv_set, image.transform) != (plain.uv_set, plain.transform)
    return not moved and sampler.wrap == plain.sampler.wrap and sampler.magnify == plain.sampler.magnify


def decode(texture: Texture) -> Array:
    """Return a colour texture as linear RGB, float32 (H, W, 3)."""
    return linear_from_srgb(texture.pixels[..., :3] / np.iinfo(texture.pixels.dtype).max).astype(np.float32)


def find_numbers(scene: Scene, material: Material) -> Array | None:
    """Return the roughness and metallic that a material's texture says, float32 (H, W, 2), if it has one."""
    image = material.metallic_roughness_texture
    if image is None or scene.geometry.uvs is None:
        return None
    pixels = scene.textures[image.number].pixels
    numbers: Array = (pixels[..., 1:3] / np.iinfo(pixels.dtype).max).astype(np.float32)
    return numbers
