"""Textures, framebuffers and buffers. Textures are raw OpenGL: moderngl has no 32-bit depth and no depth arrays."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from deferred_ir.base.arrays import Ints
from deferred_ir.base.errors import DeviceError
from deferred_ir.base.versions import new_version
from deferred_ir.gl import raw
from deferred_ir.gl.context import Gpu
from deferred_ir.graph.ports import Buffer, Texture


@dataclass(frozen=True)
class Format:
    """A texture format: OpenGL's enumerants, and how it reads back."""

    internal: int
    layout: int
    type: int
    channels: int
    dtype: str
    bytes: int

    @property
    def depth(self) -> bool:
        """Whether it is a depth format."""
        return self.layout == 0x1902


FORMATS = {
    "rgba32f": Format(0x8814, 0x1908, 0x1406, 4, "f4", 16),
    "rgba16f": Format(0x881A, 0x1908, 0x1406, 4, "f4", 8),
    "rgba16": Format(0x805B, 0x1908, 0x1406, 4, "f4", 8),
    "rgba8": Format(0x8058, 0x1908, 0x1401, 4, "u1", 4),
    "r32f": Format(0x822E, 0x1903, 0x1406, 1, "f4", 4),
    "rg32ui": Format(0x823C, 0x8228, 0x1405, 2, "u4", 8),
    "r32ui": Format(0x8236, 0x8D94, 0x1405, 1, "u4", 4),
    "depth32f": Format(0x8CAC, 0x1902, 0x1406, 1, "f4", 4),
}
"""Formats by the names that ports use; `rgba16` and `rgba8` are normalised integers."""

SCRATCH_UNIT = 31
"""Texture unit in which textures are filled and read, so that those bound for a pass stay: their units end at 15."""


class GpuTexture:
    """A 2D texture or array of one level. `size` is (width, height), `layers` how many an array has now, else 0.

    nbytes: what the driver has allocated for its texels. version: another number whenever something was written into
    it, unlike that of any other texture or buffer.
    """

    def __init__(self, gpu: Gpu, description: Texture, size: tuple[int, int]) -> None:
        self.gpu, self.description, self.size = gpu, description, size
        self.format = FORMATS[description.format]
        self.target = raw.TEXTURE_2D_ARRAY if description.layers else raw.TEXTURE_2D
        self._allocate(min(description.layers, 1) if description.grows else description.layers)

    def _allocate(self, layers: int) -> None:
        """Have OpenGL make it."""
        gl, self.layers = self.gpu.gl, layers
        self.touch()
        self.glo = gl.make("GenTextures")
        self._bind_to_work()
        if layers:
            gl.TexStorage3D(self.target, 1, self.format.internal, *self.size, layers)
        else:
            gl.TexStorage2D(self.target, 1, self.format.internal, *self.size)
        try:
            nominal = self.size[0] * self.size[1] * max(layers, 1) * self.format.bytes
            gl.check(f"texture {self.description} of {nominal / 2**20:.0f} MiB")
        except DeviceError:
            self.release()
            raise
        self.nbytes = self.measured()

    def measured(self) -> int:
        """Its size by what the driver says that it has allocated, bytes."""
        self._bind_to_work()

        def asked(what: int) -> int:
            value = ctypes.c_int()
            self.gpu.gl.GetTexLevelParameteriv(self.target, 0, what, ctypes.byref(value))
            return value.value

        bits = sum(asked(what) for what in raw.TEXTURE_BITS)
        return asked(raw.TEXTURE_WIDTH) * asked(raw.TEXTURE_HEIGHT) * asked(raw.TEXTURE_DEPTH) * bits // 8

    def fit(self, layers: int) -> bool:
        """Have `layers` layers, or up to twice as many if it has them; whether it was made anew for that.

        Then it holds nothing, and is to be attached again (`Framebuffer.attach`).
        """
        if layers <= self.layers <= 2 * layers:
            return False
        self.gpu.gl.delete("DeleteTextures", self.glo)
        try:
            self._allocate(layers)
        except DeviceError:
            self._allocate(1)
            raise
        return True

    def touch(self) -> None:
        """Note that something else was written into it."""
        self.version = new_version()

    def upload(self, pixels: Any) -> None:
        """Fill it from (H, W, channels) or (layers, H, W, channels), bottom row first, in the format's dtype."""
        self.touch()
        gl, data = self.gpu.gl, np.ascontiguousarray(pixels, self.format.dtype)
        self._bind_to_work()
        gl.PixelStorei(0x0CF5, 1)  # UNPACK_ALIGNMENT
        source = self.format.layout, self.format.type, data.ctypes.data_as(ctypes.c_void_p)
        if self.description.layers:
            gl.TexSubImage3D(self.target, 0, 0, 0, 0, *self.size, self.layers, *source)
        else:
            gl.TexSubImage2D(self.target, 0, 0, 0, *self.size, *source)

    def _bind_to_work(self) -> None:
        """Make it the texture that OpenGL's functions for textures act on."""
        self.gpu.gl.ActiveTexture(raw.TEXTURE0 + SCRATCH_UNIT)
        self.gpu.gl.BindTexture(self.target, self.glo)

    def bind(self, unit: int, sampler: Any) -> None:
        """Make it readable through texture `unit` with a moderngl sampler."""
        self.gpu.gl.ActiveTexture(raw.TEXTURE0 + unit)
        self.gpu.gl.BindTexture(self.target, self.glo)
        sampler.use(unit)

    def bind_image(self, unit: int) -> None:
        """Let shaders load and store its texels through image `unit`."""
        self.gpu.gl.BindImageTexture(unit, self.glo, 0, 0, 0, raw.READ_WRITE, self.format.internal)

    def read(self) -> np.ndarray:
        """All texels, (H, W, channels) or (layers, H, W, channels), bottom row first."""
        layers = (self.layers,) if self.layers else ()
        pixels = np.empty((*layers, self.size[1], self.size[0], self.format.channels), self.format.dtype)
        gl = self.gpu.gl
        self._bind_to_work()
        gl.PixelStorei(0x0D05, 1)  # PACK_ALIGNMENT
        gl.GetTexImage(self.target, 0, self.format.layout, self.format.type, pixels.ctypes.data_as(ctypes.c_void_p))
        gl.check(f"reading {self.description}")
        return pixels

    def fill(self, byte: int) -> None:
        """Fill it with a byte, in whatever its texels are stored as."""
        self.touch()
        # As floats they would be rounded to what fits; whole numbers of the stored width go in as they are.
        texel = (ctypes.c_ubyte * 16)(*[byte] * 16)
        where = (0, 0, 0, 0, *self.size, max(self.layers, 1))
        self.gpu.gl.ClearTexSubImage(self.glo, *where, self.format.layout, self.format.type, texel)

    def clear_part(self, layer: int, corner: tuple[int, int], edge: int) -> None:
        """Fill a square of one layer with zeros; corner: (x, y) of its lower left texel."""
        zero = (ctypes.c_float * 4)()
        where = (0, *corner, layer, edge, edge, 1)
        self.gpu.gl.ClearTexSubImage(self.glo, *where, self.format.layout, self.format.type, zero)

    @cached_property
    def framebuffer(self) -> Framebuffer:
        """A framebuffer of this texture alone."""
        return Framebuffer(self.gpu, {"texture": self}, str(self.description))

    def release(self) -> None:
        """Give the texture back, and its own framebuffer."""
        if "framebuffer" in self.__dict__:
            self.framebuffer.release()
        self.gpu.gl.delete("DeleteTextures", self.glo)


class Framebuffer:
    """The textures a pass draws into: colours in the order given, at most one depth. Arrays are attached whole."""

    def __init__(self, gpu: Gpu, textures: Mapping[str, GpuTexture], name: str) -> None:
        self.gpu, self._textures, self._name = gpu, textures, name
        self.size = next(iter(textures.values())).size
        self.glo = gpu.gl.make("GenFramebuffers")
        self.colors = [texture for texture in textures.values() if not texture.format.depth]
        self.attach()

    def attach(self) -> None:
        """Attach its textures as they are now, and bind it."""
        gl, textures = self.gpu.gl, self._textures
        gl.BindFramebuffer(raw.FRAMEBUFFER, self.glo)
        for i, color in enumerate(self.colors):
            gl.FramebufferTexture(raw.FRAMEBUFFER, raw.COLOR_ATTACHMENT0 + i, color.glo, 0)
        for texture in textures.values():
            if texture.format.depth:
                gl.FramebufferTexture(raw.FRAMEBUFFER, raw.DEPTH_ATTACHMENT, texture.glo, 0)
        targets = [raw.COLOR_ATTACHMENT0 + i for i in range(len(self.colors))]
        gl.DrawBuffers(len(targets), (ctypes.c_uint * len(targets))(*targets))
        status = gl.CheckFramebufferStatus(raw.FRAMEBUFFER)
        if status != raw.FRAMEBUFFER_COMPLETE:
            gl.check(f"framebuffer of {self._name}")
            raise ValueError(f"{self._name}: framebuffer incomplete (0x{status:04x}): outputs differ in size or layers")

    def bind(self) -> None:
        """Draw into it from now on, over its whole size."""
        self.gpu.gl.BindFramebuffer(raw.FRAMEBUFFER, self.glo)
        self.gpu.gl.Viewport(0, 0, *self.size)

    def clear_color(self, index: int = 0, value: tuple[float, float, float, float] = (0, 0, 0, 0)) -> None:
        """Fill colour target `index`."""
        if self.colors[index].format.dtype == "u4":
            self.gpu.gl.ClearBufferuiv(raw.COLOR, index, (ctypes.c_uint * 4)(*(int(v) for v in value)))
        else:
            self.gpu.gl.ClearBufferfv(raw.COLOR, index, (ctypes.c_float * 4)(*value))

    def clear_depth(self, value: float = 0.0) -> None:
        """Fill the depth target; 0 is infinitely far in reversed depth."""
        self.gpu.gl.ClearBufferfv(raw.DEPTH, 0, (ctypes.c_float * 1)(value))

    def release(self) -> None:
        """Give the framebuffer back; its textures stay."""
        self.gpu.gl.delete("DeleteFramebuffers", self.glo)


class GpuBuffer:
    """A buffer of records that a pass writes from the CPU; `records` is what it wrote last.

    versions: a number for each record; as long as it is the same, so is what is drawn for that record. None: unknown.
    version: another number whenever what it holds has changed.
    """

    def __init__(self, gpu: Gpu, description: Buffer) -> None:
        self.gpu, self.description = gpu, description
        self.nbytes = -(-description.records // description.block) * description.block * description.stride
        self.buffer = gpu.ctx.buffer(reserve=self.nbytes, dynamic=True)
        gpu.gl.check(f"buffer of {description}")
        self.records: np.ndarray = np.zeros(0)
        self._held: tuple[bytes, bytes | None] = b"", None
        self.versions: Ints | None = None
        self.version = new_version()

    def write(self, records: np.ndarray, versions: Ints | None = None) -> None:
        """Replace the first len(records) records."""
        if len(records) > self.description.records or records.itemsize != self.description.stride:
            raise ValueError(f"{len(records)} records of {records.itemsize} bytes into a buffer of {self.description}")
        held = records.tobytes(), None if versions is None else versions.tobytes()
        self.records, self.versions = records, versions
        self.buffer.write(held[0])
        if held != self._held:
            self.version = new_version()
        self._held = held  # last: a write that is broken off is none, and must be new when it is done again

    def bind_uniform(self, binding: int, block: int) -> None:
        """Make block number `block` of the records visible as a uniform block."""
        nbytes = self.description.block * self.description.stride
        self.buffer.bind_to_uniform_block(binding, offset=block * nbytes, size=nbytes)

    def release(self) -> None:
        """Give the buffer back."""
        self.buffer.release()
