"""Texture formats by name, with OpenGL's enumerants."""

from __future__ import annotations

from dataclasses import dataclass

from deferred_ir.gl import raw


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
