"""Textures, by raw OpenGL: moderngl has no 32-bit depth and no depth arrays."""

from __future__ import annotations

import ctypes
from functools import cached_property
from typing import Any

import numpy as np

from deferred_ir.base.errors import DeviceError
from deferred_ir.base.versions import new_version
from deferred_ir.gl import raw
from deferred_ir.gl.context import Gpu
from deferred_ir.gl.formats import FORMATS
from deferred_ir.gl.framebuffers import Framebuffer
from deferred_ir.graph.ports import Texture

SCRATCH_UNIT = 31
"""Texture unit for filling and reading textures, beyond those of passes, which end at 15 and so stay bound."""


class GpuTexture:
    """A 2D texture or array texture. size: (width, height). layers: of an array, at present; else 0.

    has_levels: it has mipmaps, which `make_levels` fills; else one level. nbytes: what the driver has allocated for its
    texels. version: a process-wide unique number, a new one whenever something was written into it.
    """

    def __init__(self, gpu: Gpu, description: Texture, size: tuple[int, int], *, has_levels: bool = False) -> None:
        self.gpu, self.description, self.size = gpu, description, size
        self.format = FORMATS[description.format]
        self._levels = max(size).bit_length() if has_levels else 1
        self.target = raw.TEXTURE_2D_ARRAY if description.layers else raw.TEXTURE_2D
        self._allocate(min(description.layers, 1) if description.grows else description.layers)

    def _allocate(self, layers: int) -> None:
        """Create the texture in OpenGL."""
        gl, self.layers = self.gpu.gl, layers
        self.touch()
        self.glo = gl.make("GenTextures")
        self._bind_to_work()
        if layers:
            gl.TexStorage3D(self.target, self._levels, self.format.internal, *self.size, layers)
        else:
            gl.TexStorage2D(self.target, self._levels, self.format.internal, *self.size)
        try:
            nominal = self.size[0] * self.size[1] * max(layers, 1) * self.format.bytes
            gl.check(f"texture {self.description} of {nominal / 2**20:.0f} MiB")
        except DeviceError:
            self.release()
            raise
        self.nbytes = self.measure()

    def measure(self) -> int:
        """Return the bytes that the driver says it has allocated."""
        self._bind_to_work()

        def parameter(name: int) -> int:
            value = ctypes.c_int()
            self.gpu.gl.GetTexLevelParameteriv(self.target, 0, name, ctypes.byref(value))
            return value.value

        bits = sum(parameter(name) for name in raw.TEXTURE_BITS)
        first = parameter(raw.TEXTURE_WIDTH) * parameter(raw.TEXTURE_HEIGHT) * parameter(raw.TEXTURE_DEPTH) * bits // 8
        return first * 4 // 3 if self._levels > 1 else first

    def fit(self, layers: int) -> bool:
        """Make room for `layers` layers; up to twice as many are fine. Returns whether it was allocated anew for that.

        Then its contents are undefined, and it has to be attached again (`Framebuffer.attach`).
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
        """Take a new version: something was written into it."""
        self.version = new_version()

    def upload(self, pixels: Any) -> None:
        """Fill it from (H, W, channels) or (layers, H, W, channels), bottom row first, in the format's dtype."""
        self.touch()
        gl, data = self.gpu.gl, np.ascontiguousarray(pixels, self.format.dtype)
        self._bind_to_work()
        gl.PixelStorei(raw.UNPACK_ALIGNMENT, 1)
        source = self.format.layout, self.format.type, data.ctypes.data_as(ctypes.c_void_p)
        if self.description.layers:
            gl.TexSubImage3D(self.target, 0, 0, 0, 0, *self.size, self.layers, *source)
        else:
            gl.TexSubImage2D(self.target, 0, 0, 0, *self.size, *source)

    def upload_layer(self, layer: int, pixels: Any) -> None:
        """Fill level 0 of one layer from (H, W, channels), as `upload` does."""
        self.touch()
        gl, data = self.gpu.gl, np.ascontiguousarray(pixels, self.format.dtype)
        self._bind_to_work()
        gl.PixelStorei(raw.UNPACK_ALIGNMENT, 1)
        source = self.format.layout, self.format.type, data.ctypes.data_as(ctypes.c_void_p)
        gl.TexSubImage3D(self.target, 0, 0, 0, layer, *self.size, 1, *source)

    def make_levels(self) -> None:
        """Compute all mipmaps from level 0."""
        self._bind_to_work()
        self.gpu.gl.GenerateMipmap(self.target)

    def _bind_to_work(self) -> None:
        """Bind it in the scratch unit, where OpenGL's texture functions act on it."""
        self.gpu.gl.ActiveTexture(raw.TEXTURE0 + SCRATCH_UNIT)
        self.gpu.gl.BindTexture(self.target, self.glo)

    def bind(self, unit: int, sampler: Any) -> None:
        """Make it readable through texture `unit` with a moderngl sampler."""
        self.gpu.gl.ActiveTexture(raw.TEXTURE0 + unit)
        self.gpu.gl.BindTexture(self.target, self.glo)
        sampler.use(unit)

    def bind_image(self, unit: int) -> None:
        """Let shaders load and store its texels through image `unit`."""
        self.gpu.gl.BindImageTexture(unit, self.glo, 0, bool(self.layers), 0, raw.READ_WRITE, self.format.internal)

    def read(self) -> np.ndarray:
        """Return all texels, (H, W, channels) or (layers, H, W, channels), bottom row first."""
        layers = (self.layers,) if self.layers else ()
        pixels = np.empty((*layers, self.size[1], self.size[0], self.format.channels), self.format.dtype)
        gl = self.gpu.gl
        self._bind_to_work()
        gl.PixelStorei(raw.PACK_ALIGNMENT, 1)
        gl.GetTexImage(self.target, 0, self.format.layout, self.format.type, pixels.ctypes.data_as(ctypes.c_void_p))
        gl.check(f"reading {self.description}")
        return pixels

    def fill(self, byte: int) -> None:
        """Set every byte of its texels to `byte`."""
        self.touch()
        # Given as floats, values would be rounded; integers of the stored width are copied unchanged.
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
        """A framebuffer with this texture alone."""
        return Framebuffer(self.gpu, {"texture": self}, str(self.description))

    def release(self) -> None:
        """Delete the texture and its own framebuffer."""
        if "framebuffer" in self.__dict__:
            self.framebuffer.release()
        self.gpu.gl.delete("DeleteTextures", self.glo)
