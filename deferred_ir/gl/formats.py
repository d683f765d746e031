"""Texture formats, filters and wrap modes by name, with OpenGL's enumerants, and samplers of images.

moderngl's samplers cannot mirror.
"""

from __future__ import annotations

from dataclasses import dataclass

from deferred_ir.gl import raw
from deferred_ir.gl.raw import GL


@dataclass(frozen=True)
class Format:
    """A texture format: OpenGL's internal format, the layout and type of texels on the CPU, and bytes a texel."""

    internal: int
    layout: int
    type: int
    channels: int
    dtype: str
    bytes: int

    @property
    def depth(self) -> bool:
        """Whether it is a depth format."""
        return self.layout == raw.DEPTH_COMPONENT


FORMATS = {
    "rgba32f": Format(raw.RGBA32F, raw.RGBA, raw.FLOAT, 4, "f4", 16),
    "rgba16f": Format(raw.RGBA16F, raw.RGBA, raw.FLOAT, 4, "f4", 8),
    "rgba16": Format(raw.RGBA16, raw.RGBA, raw.FLOAT, 4, "f4", 8),
    "rgba8": Format(raw.RGBA8, raw.RGBA, raw.UNSIGNED_BYTE, 4, "u1", 4),
    "r32f": Format(raw.R32F, raw.RED, raw.FLOAT, 1, "f4", 4),
    "rgba32ui": Format(raw.RGBA32UI, raw.RGBA_INTEGER, raw.UNSIGNED_INT, 4, "u4", 16),
    "rg32ui": Format(raw.RG32UI, raw.RG_INTEGER, raw.UNSIGNED_INT, 2, "u4", 8),
    "r32ui": Format(raw.R32UI, raw.RED_INTEGER, raw.UNSIGNED_INT, 1, "u4", 4),
    "depth32f": Format(raw.DEPTH_COMPONENT32F, raw.DEPTH_COMPONENT, raw.FLOAT, 1, "f4", 4),
}
"""Formats by the names that ports use; `rgba16` and `rgba8` are normalised integers."""
WRAPS = {"repeat": raw.REPEAT, "mirror": raw.MIRRORED_REPEAT, "clamp": raw.CLAMP_TO_EDGE}
FILTERS = {
    ("nearest", None): raw.NEAREST,
    ("linear", None): raw.LINEAR,
    ("nearest", "nearest"): raw.NEAREST_MIPMAP_NEAREST,
    ("linear", "nearest"): raw.LINEAR_MIPMAP_NEAREST,
    ("nearest", "linear"): raw.NEAREST_MIPMAP_LINEAR,
    ("linear", "linear"): raw.LINEAR_MIPMAP_LINEAR,
}
"""By the filter within a level and that between levels."""


class ImageSampler:
    """How an image is read: filters, and what lies beyond its edges.

    magnify, minify, levels: "nearest" or "linear"; levels: None for level 0 alone. wrap: "repeat", "mirror" or "clamp",
    for u and for v. anisotropy: samples along the longer side of a pixel's footprint, where levels are blended.
    """

    def __init__(
        self, gl: GL, magnify: str, minify: str, levels: str | None, *, wrap: tuple[str, str], anisotropy: int = 1
    ) -> None:
        self._gl, self._name = gl, gl.make("GenSamplers")
        values = {raw.MAG_FILTER: FILTERS[magnify, None], raw.MIN_FILTER: FILTERS[minify, levels]}
        values |= {parameter: WRAPS[how] for parameter, how in zip(raw.WRAP, wrap, strict=True)}
        if anisotropy > 1 and minify == levels == "linear":
            values[raw.MAX_ANISOTROPY] = anisotropy
        for parameter, value in values.items():
            gl.SamplerParameteri(self._name, parameter, value)

    def use(self, unit: int) -> None:
        """Bind it to a texture unit."""
        self._gl.BindSampler(unit, self._name)

    def release(self) -> None:
        """Delete it."""
        self._gl.delete("DeleteSamplers", self._name)
