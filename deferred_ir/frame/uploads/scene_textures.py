"""The images of a scene's materials on the GPU: those of one size, format and sampler are layers of one array.

So a draw call reaches as many materials as have their images in the same arrays, and finds the layer by the material.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from deferred_ir.base.arrays import Array
from deferred_ir.base.colour import linear_from_srgb, srgb_table
from deferred_ir.base.errors import DeviceError
from deferred_ir.gl.context import Gpu
from deferred_ir.gl.textures import GpuTexture
from deferred_ir.graph.ports import Texture as Description
from deferred_ir.scene.surfaces.materials import SLOTS, Material, Sampler, Texture

COLORS = frozenset({"base_color", "emission"})
"""Slots whose images are sRGB; others hold numbers."""


@dataclass(frozen=True)
class _Kind:
    """What the images of an array have in common."""

    size: tuple[int, int]
    format: str
    sampler: Sampler


class SceneTextures:
    """Texture arrays of all slots.

    arrays: number of the array for each slot and material, int (slots, materials), -1 for none; layers: the layer in
    it, alike.
    """

    def __init__(self, gpu: Gpu, materials: Sequence[Material], textures: Sequence[Texture]) -> None:
        self._gpu, self._textures = gpu, textures
        self._kinds: list[_Kind] = []
        self._contents: list[list[int]] = []
        self.arrays = np.full((len(SLOTS), len(materials)), -1)
        self.layers = np.zeros((len(SLOTS), len(materials)), int)
        for number, material in enumerate(materials):
            for slot, name in enumerate(SLOTS):
                texture = material.textures[name]
                if texture is not None:
                    image = textures[texture.number]
                    kind = _Kind(_find_size(image), _choose_format(image, color=name in COLORS), texture.sampler)
                    self.arrays[slot, number], self.layers[slot, number] = self._place(kind, texture.number)
        for kind, contents in zip(self._kinds, self._contents, strict=True):
            self._check(kind, textures[contents[0]])
        self._made: dict[tuple[int, bool], GpuTexture] = {}
        for number, kind in enumerate(self._kinds):
            self._find(number, has_levels=kind.sampler.mipmaps is not None)

    @property
    def nbytes(self) -> int:
        """Bytes of all arrays."""
        return sum(array.nbytes for array in self._made.values())

    def bind(self, unit: int, array: int, mipmaps: str) -> None:
        """Bind an array for reading. mipmaps: "auto" as files say, "always" or "never"."""
        sampler = self._kinds[array].sampler
        levels = sampler.mipmaps
        if mipmaps != "auto":
            levels = None if mipmaps == "never" else levels or "linear"
        found = self._find(array, has_levels=levels is not None)
        found.bind(unit, self._gpu.image_sampler(sampler.magnify, sampler.minify, levels, sampler.wrap))

    def release(self) -> None:
        """Delete all arrays."""
        for array in self._made.values():
            array.release()

    def _place(self, kind: _Kind, texture: int) -> tuple[int, int]:
        """Return the array and the layer of a texture, which get a place if they have none."""
        for number, other in enumerate(self._kinds):
            if other == kind and texture in self._contents[number]:
                return number, self._contents[number].index(texture)
        for number, other in enumerate(self._kinds):
            if other == kind and len(self._contents[number]) < self._gpu.max_layers:
                self._contents[number].append(texture)
                return number, len(self._contents[number]) - 1
        self._kinds.append(kind)
        self._contents.append([texture])
        return len(self._kinds) - 1, 0

    def _check(self, kind: _Kind, texture: Texture) -> None:
        """Raise DeviceError if the driver takes no texture as large."""
        width, height = kind.size
        if max(width, height) > self._gpu.max_size:
            raise DeviceError(
                f"{texture.name}: {width}x{height} pixels, and this driver takes at most {self._gpu.max_size}; "
                "scale the image down"
            )

    def _find(self, number: int, *, has_levels: bool) -> GpuTexture:
        """Return an array, filled; one without mipmaps has a single level."""
        key = number, has_levels
        if key not in self._made:
            kind, contents = self._kinds[number], self._contents[number]
            description = Description(kind.format, kind.size, layers=len(contents))
            self._made[key] = made = GpuTexture(self._gpu, description, kind.size, has_levels=has_levels)
            for layer, texture in enumerate(contents):
                made.upload_layer(layer, _decode(self._textures[texture], kind.format)[::-1])
            if has_levels:
                made.make_levels()
        return self._made[key]


def _find_size(texture: Texture) -> tuple[int, int]:
    height, width = texture.pixels.shape[:2]
    return width, height


def _choose_format(texture: Texture, *, color: bool) -> str:
    if color:
        # Decoded here, into half floats: drivers may approximate sRGB (llvmpipe is 2 % off in dark texels), and rays
        # must fetch what the rasteriser shows.
        return "rgba16f"
    return "rgba8" if texture.pixels.dtype == np.uint8 else "rgba16"


def _decode(texture: Texture, format: str) -> Array:
    """Return the texels of a texture in `format`, (H, W, 4), top row first; without alpha it is 1."""
    pixels: Any = texture.pixels
    height, width, channels = pixels.shape
    top = np.iinfo(pixels.dtype).max
    if format == "rgba8":
        texels = np.full((height, width, 4), top, np.uint8)
        texels[..., :channels] = pixels
        return texels
    texels = np.ones((height, width, 4), np.float32)
    if format == "rgba16":
        texels[..., :channels] = pixels / np.float32(top)
        return texels
    table = srgb_table() if top == 255 else linear_from_srgb(np.arange(top + 1) / top)
    texels[..., :3] = table.astype(np.float16)[pixels[..., :3]]
    if channels > 3:
        texels[..., 3] = pixels[..., 3] / np.float32(top)
    return texels
