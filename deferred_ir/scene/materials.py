"""Materials and the image textures that they name."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from deferred_ir.base.arrays import Array, Vec3
from deferred_ir.base.colour import srgb_table


@dataclass(frozen=True, eq=False)
class Texture:
    """An image texture. pixels: uint8 (H, W, 3), sRGB, top row first; v = 1 is the top edge; repeated in u and v."""

    name: str
    pixels: Any

    @cached_property
    def mean(self) -> Array:
        """Its mean linear RGB, float64 (3,)."""
        table = srgb_table().astype(np.float64)
        counts = np.stack([np.bincount(self.pixels[..., i].ravel(), minlength=256) for i in range(3)])
        mean: Array = counts @ table / max(self.pixels[..., 0].size, 1)
        return mean


@dataclass(frozen=True)
class Material:
    """A Lambertian material: reflectance is albedo (linear RGB) times texture (index into Scene.textures), if any.

    emission: radiance, linear RGB, W/(m^2 sr), times emission_texture, if any. emits_both_sides: not only from the
    front of its faces.
    """

    name: str
    albedo: Vec3
    texture: int | None = None
    emission: Vec3 = (0.0, 0.0, 0.0)
    emission_texture: int | None = None
    emits_both_sides: bool = False
