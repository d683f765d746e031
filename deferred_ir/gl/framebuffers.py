"""Framebuffers: the textures that draws go into."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping
from typing import Protocol

from deferred_ir.gl import raw
from deferred_ir.gl.context import Gpu
from deferred_ir.gl.formats import Format


class Target(Protocol):
    """What a framebuffer knows of a texture that is attached to it."""

    glo: int
    size: tuple[int, int]
    layers: int
    format: Format


class Framebuffer:
    """Textures to draw into: colours in the order given, and at most one depth.

    Each layer of a colour array is a target of its own; of a depth array all are attached, and vertices choose.
    """

    def __init__(self, gpu: Gpu, textures: Mapping[str, Target], name: str) -> None:
        self.gpu, self._textures, self._name = gpu, textures, name
        self.size = next(iter(textures.values())).size
        self.glo = gpu.gl.make("GenFramebuffers")
        colors = [texture for texture in textures.values() if not texture.format.depth]
        self.colors = [(texture, layer) for texture in colors for layer in range(max(texture.layers, 1))]
        self.attach()

    def attach(self) -> None:
        """Attach its textures, which may have been allocated anew, and bind it."""
        gl, textures = self.gpu.gl, self._textures
        gl.BindFramebuffer(raw.FRAMEBUFFER, self.glo)
        for i, (color, layer) in enumerate(self.colors):
            target = raw.COLOR_ATTACHMENT0 + i
            if color.layers:
                gl.FramebufferTextureLayer(raw.FRAMEBUFFER, target, color.glo, 0, layer)
            else:
                gl.FramebufferTexture(raw.FRAMEBUFFER, target, color.glo, 0)
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
        """Bind it, with a viewport over its whole size."""
        self.gpu.gl.BindFramebuffer(raw.FRAMEBUFFER, self.glo)
        self.gpu.gl.Viewport(0, 0, *self.size)

    def clear_color(self, index: int = 0, value: tuple[float, float, float, float] = (0, 0, 0, 0)) -> None:
        """Fill colour target `index`."""
        if self.colors[index][0].format.dtype == "u4":
            self.gpu.gl.ClearBufferuiv(raw.COLOR, index, (ctypes.c_uint * 4)(*(int(v) for v in value)))
        else:
            self.gpu.gl.ClearBufferfv(raw.COLOR, index, (ctypes.c_float * 4)(*value))

    def clear_depth(self, value: float = 0.0) -> None:
        """Fill the depth target; 0 is infinitely far in reversed depth."""
        self.gpu.gl.ClearBufferfv(raw.DEPTH, 0, (ctypes.c_float * 1)(value))

    def release(self) -> None:
        """Delete the framebuffer; its textures stay."""
        self.gpu.gl.delete("DeleteFramebuffers", self.glo)
