"""Ports of passes and what they carry: textures and buffers, described without OpenGL.

Names are one thing everywhere: a port is the sampler's name in GLSL and the key in the graph file.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class Texture:
    """A texture: `size` (width, height), None for the frame's; `layers` > 0 makes it an array.

    `copies` > 0 makes that many separate textures, which the pass itself attaches and binds one by one; `edges`: widths
    and heights of these, where they differ. `grows`: it
    begins with one layer, and its pass asks for as many as a frame needs, `layers` at most. `mend` says what to use
    where a driver takes none as large.
    """

    format: str
    size: tuple[int, int] | None = None
    layers: int = 0
    copies: int = 0
    edges: tuple[int, ...] = ()
    grows: bool = False
    mend: str = field(default="a smaller size", compare=False)

    def __str__(self) -> str:
        size = "frame" if self.size is None else f"{self.size[0]}x{self.size[1]}"
        most = "up to " if self.grows else ""
        many = f" x {most}{self.layers} layers" if self.layers else f", {self.copies} of them" if self.copies else ""
        return f"{self.format} {size}{many}"


@dataclass(frozen=True)
class Buffer:
    """A buffer of up to `records` records of `format`, `stride` bytes each, allocated in blocks of `block` records.

    parts: how many nearly equal parts its records are dealt into, one after the other. binding: the uniform block in
    which shaders read a block of it.
    """

    format: str
    records: int
    stride: int
    block: int = 1
    parts: int = 1
    binding: int = 0

    def __str__(self) -> str:
        return f"{self.records} {self.format}"


Description = Texture | Buffer


def is_storable(description: Description) -> bool:
    """Return whether shaders can store into it as an image."""
    return isinstance(description, Texture) and not description.copies and not description.format.startswith("depth")


@dataclass(frozen=True)
class Input:
    """A port that reads. `format` None takes any. Filter and comparison belong to the reader, not to the texture.

    `attach`: a depth texture that the pass tests against, attached to its framebuffer instead of sampled.
    `replaces`: optional, and where it is connected the pass is left out, for its readers use the source instead.
    """

    doc: str
    format: str | None = None
    optional: bool = False
    linear: bool = False
    compare: str | None = None
    attach: bool = False
    replaces: bool = False


@dataclass(frozen=True)
class Output:
    """A port that writes. `defines` tell the readers' shaders what they must know of the writer (layout, encoding).

    `attach` False: a texture that is no target of the pass's framebuffer. `image`: shaders store into it wherever they
    like; it is bound to the image unit `IMAGE_<PORT>` while the pass runs.
    `spare`: the pass can do without it, and does where nothing reads it; its shader asks for `TARGET_<PORT>`.
    `transient`: a texture that each frame writes whole and the next does not read, so that once its last reader is done
    another output of the same description may use it.
    `meta`: a frozen dataclass for the readers' code on the CPU (`io.meta`), as `defines` are for their shaders.
    """

    doc: str
    description: Description
    defines: Mapping[str, int | float] = field(default_factory=dict)
    attach: bool = True
    image: bool = False
    spare: bool = False
    transient: bool = False
    meta: Any = None
