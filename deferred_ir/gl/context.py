"""An OpenGL context: moderngl's object for it, the raw functions, limits, samplers and state that passes share."""

from __future__ import annotations

import os
from functools import cached_property
from typing import Any

from deferred_ir.gl import devices, raw
from deferred_ir.gl.debug import SWITCH, DebugOutput
from deferred_ir.gl.devices import Loader
from deferred_ir.gl.formats import ImageSampler

MOST_ANISOTROPIC = 16


class Gpu:
    """A context on a device (see devices.create_context), current in the thread that made it. Close it when done.

    window: use the context of this window, which is current, instead of a headless one; closing does not destroy it.
    """

    def __init__(self, device: str = "auto", window: Loader | None = None) -> None:
        self._headless = window is None
        opened = devices.create_context(device) if window is None else devices.adopt(window)
        self.ctx, self._loader, self.device = opened
        self.gl = raw.GL(self._loader)
        if os.environ.get(SWITCH):
            self.gl.debug = DebugOutput(self.ctx, self.gl)
        extensions = self.ctx.extensions
        self.layer_from_vertex = "GL_ARB_shader_viewport_layer_array" in extensions
        self.clip_control = "GL_ARB_clip_control" in extensions or self.ctx.version_code >= 450
        if self.clip_control:
            self.gl.ClipControl(raw.LOWER_LEFT, raw.ZERO_TO_ONE)
        self._clipped = 0
        self._uniforms: Any = None
        self._samplers: dict[Any, Any] = {}

    @property
    def driver(self) -> str:
        """What the driver calls its OpenGL (GL_VERSION), for most drivers with their own version."""
        return str(self.ctx.info["GL_VERSION"])

    @cached_property
    def max_size(self) -> int:
        """Largest width or height of a render target."""
        texture = self.gl.integers(raw.MAX_TEXTURE_SIZE)
        return min(*texture, *self.gl.integers(raw.MAX_VIEWPORT_DIMS, 2))

    @cached_property
    def max_layers(self) -> int:
        """Most layers of an array texture."""
        return self.gl.integers(raw.MAX_ARRAY_LAYERS)[0]

    @property
    def defines(self) -> dict[str, int]:
        """Defines that tell shaders what the driver can do."""
        return {"CLIP_CONTROL": int(self.clip_control), "LAYER_FROM_VERTEX": int(self.layer_from_vertex)}

    def sampler(self, linear: bool, compare: str | None = None) -> Any:
        """Return a shared sampler object: filter and comparison belong to the reader, never to the texture."""
        key = linear, compare
        if key not in self._samplers:
            name = self.ctx.LINEAR if linear else self.ctx.NEAREST
            sampler = self.ctx.sampler(repeat_x=False, repeat_y=False, filter=(name, name))
            if compare:
                sampler.compare_func = compare
            self._samplers[key] = sampler
        return self._samplers[key]

    def image_sampler(self, magnify: str, minify: str, levels: str | None, wrap: tuple[str, str]) -> Any:
        """Return a shared ImageSampler; filters over levels are anisotropic where the driver can."""
        key = magnify, minify, levels, wrap
        if key not in self._samplers:
            most = int(min(MOST_ANISOTROPIC, self.ctx.max_anisotropy))
            self._samplers[key] = ImageSampler(self.gl, magnify, minify, levels, wrap=wrap, anisotropy=most)
        return self._samplers[key]

    def reset(self) -> None:
        """Set the state that each pass starts from: no tests, no clipping, no blending, all writes on."""
        ctx = self.ctx
        ctx.disable(ctx.DEPTH_TEST | ctx.CULL_FACE | ctx.BLEND)
        self.clip(0)
        self.scissor(None)
        self.gl.DepthMask(1)
        self.gl.ColorMask(1, 1, 1, 1)

    def scissor(self, rectangle: tuple[int, int, int, int] | None) -> None:
        """Restrict drawing to x, y, width, height; None lifts the restriction."""
        if rectangle is None:
            self.ctx.disable_direct(raw.SCISSOR_TEST)
        else:
            self.ctx.enable_direct(raw.SCISSOR_TEST)
            self.gl.Scissor(*rectangle)

    def uniforms(self, data: bytes) -> Any:
        """Return a buffer that begins with `data` until the next call; `free_uniforms` deletes it."""
        if self._uniforms is None:
            self._uniforms = self.ctx.buffer(reserve=len(data), dynamic=True)
        self._uniforms.orphan(max(len(data), self._uniforms.size))
        self._uniforms.write(data)
        return self._uniforms

    def free_uniforms(self) -> None:
        """Delete the buffer of `uniforms`, if there is one."""
        if self._uniforms is not None:
            self._uniforms.release()
            self._uniforms = None

    @property
    def nbytes(self) -> int:
        """Size of the buffer of `uniforms`."""
        return self._uniforms.size if self._uniforms else 0

    def barrier(self) -> None:
        """Make what shaders have stored into images visible to later draws, uploads and reads."""
        self.gl.MemoryBarrier(
            raw.IMAGE_ACCESS_BARRIER | raw.TEXTURE_FETCH_BARRIER | raw.TEXTURE_UPDATE_BARRIER | raw.FRAMEBUFFER_BARRIER
        )

    def check(self, where: str) -> None:
        """With debug output on (DEFERRED_IR_DEBUG): raise DeviceError for faults that OpenGL has reported."""
        if self.gl.debug:
            self.gl.debug.check(where)

    def clip(self, count: int) -> None:
        """Clip by the first `count` of gl_ClipDistance, and by none of the others."""
        for side in range(min(count, self._clipped), max(count, self._clipped)):
            (self.ctx.enable_direct if count > side else self.ctx.disable_direct)(raw.CLIP_DISTANCE0 + side)
        self._clipped = count

    def close(self) -> None:
        """Destroy the context and all that lives in it; a window's context is left to the window."""
        with self.ctx:  # in another current context the same names are other objects
            for sampler in self._samplers.values():
                sampler.release()
            self.free_uniforms()
        if self._headless:
            devices.close(self.ctx, self._loader)
        else:
            self.ctx.release()
        self.check("closing")
