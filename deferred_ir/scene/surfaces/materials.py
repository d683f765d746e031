"""Materials and the image textures that they name."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np

from deferred_ir.base.arrays import Array, Vec3
from deferred_ir.base.colour import linear_from_srgb

Wrap = Literal["repeat", "mirror", "clamp"]
Filter = Literal["nearest", "linear"]
Affine = tuple[float, float, float, float, float, float]
IDENTITY: Affine = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0)
WHITE: Vec3 = (1.0, 1.0, 1.0)
BLACK: Vec3 = (0.0, 0.0, 0.0)


@dataclass(frozen=True, eq=False)
class Texture:
    """An image: uint8 or uint16 (H, W, 3) or, with coverage, (H, W, 4), top row first; v = 1 is the top edge.

    Where it is a colour, red, green and blue are sRGB; coverage, and other numbers, are linear.
    """

    name: str
    pixels: Any

    @cached_property
    def mean(self) -> Array:
        """Its mean linear RGB, taken as a colour, float64 (3,)."""
        top = np.iinfo(self.pixels.dtype).max
        table = linear_from_srgb(np.arange(top + 1) / top)
        counts = np.stack([np.bincount(self.pixels[..., i].ravel(), minlength=top + 1) for i in range(3)])
        mean: Array = counts @ table / max(self.pixels[..., 0].size, 1)
        return mean


@dataclass(frozen=True)
class Sampler:
    """How a texture is read beyond its edges and between its texels.

    mipmaps: how levels are chosen where it is made smaller; None: level 0 alone.
    """

    wrap: tuple[Wrap, Wrap] = ("repeat", "repeat")
    magnify: Filter = "linear"
    minify: Filter = "linear"
    mipmaps: Filter | None = None


@dataclass(frozen=True)
class TextureRef:
    """A texture as a material reads it.

    number: index into the scene's textures. uv_set: which texture coordinates, 0 or 1. transform: rows of the affine
    map that takes (u, v, 1) to where the image is read.
    """

    number: int
    uv_set: int = 0
    transform: Affine = IDENTITY
    sampler: Sampler = field(default_factory=Sampler)


@dataclass(frozen=True)
class Material:
    """A surface's reflection, by glTF's metallic-roughness model (brdf.py), and its emission.

    Each number is multiplied by the channels of a texture, if there is one. Colours are linear RGB.

    base_color: albedo of what is no metal, reflectance head-on of a metal. metallic_roughness_texture: roughness in
    green, metallic in blue. specular: weight of a dielectric's gloss; 0, and metallic 0, is a Lambertian surface.
    specular_color: factor on its reflectance head-on, which follows from ior. normal_scale: factor on the normal map's
    x and y. emission: radiance, W/(m^2 sr). emits_both_sides: not only from the front of its faces. unlit: its emission
    is seen and lights nothing. alpha: coverage, times the base colour texture's; what has less than alpha_cutoff is
    not there; None: all is.
    """

    name: str
    base_color: Vec3
    base_color_texture: TextureRef | None = None
    emission: Vec3 = BLACK
    emission_texture: TextureRef | None = None
    emits_both_sides: bool = False
    unlit: bool = False
    metallic: float = 0.0
    roughness: float = 1.0
    metallic_roughness_texture: TextureRef | None = None
    specular: float = 0.0
    specular_color: Vec3 = WHITE
    ior: float = 1.5
    normal_texture: TextureRef | None = None
    normal_scale: float = 1.0
    alpha: float = 1.0
    alpha_cutoff: float | None = None

    @property
    def is_glossy(self) -> bool:
        """Whether it reflects other than as a Lambertian surface."""
        return self.metallic > 0 or self.specular > 0

    @property
    def is_cut(self) -> bool:
        """Whether some of it may not be there."""
        return self.alpha_cutoff is not None

    @property
    def emits(self) -> bool:
        """Whether it is seen to emit."""
        return any(self.emission)

    @property
    def textures(self) -> dict[str, TextureRef | None]:
        """Its textures by slot, all slots."""
        return {slot: getattr(self, f"{slot}_texture") for slot in SLOTS}

    def with_textures(self, textures: Mapping[str, TextureRef | None]) -> Material:
        """Return the material with other textures in the slots named."""
        changed: dict[str, Any] = {f"{slot}_texture": texture for slot, texture in textures.items()}
        return replace(self, **changed)


SLOTS = ("base_color", "emission", "metallic_roughness", "normal")
"""What of a material a texture may say."""
