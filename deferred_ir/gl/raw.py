"""OpenGL functions that moderngl does not have, called by name through ctypes: `gl.BindTexture(target, name)`."""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from deferred_ir.base.errors import DeviceError
from deferred_ir.gl.devices import Loader

if TYPE_CHECKING:
    from deferred_ir.gl.debug import DebugOutput

_U, _I, _F, _P = ctypes.c_uint, ctypes.c_int, ctypes.c_float, ctypes.c_void_p
KINDS = "Texture", "Buffer", "Program", "VertexArray", "Framebuffer", "Sampler", "Query"
"""Kinds of objects that `GL.count_objects` counts."""
HIGHEST = 1 << 17
"""Objects are looked for by names below this. They are small numbers, though drivers may count on."""
_SIGNATURES: dict[str, tuple[Any, ...]] = {  # result, arguments
    "ActiveTexture": (None, _U),
    "BindFramebuffer": (None, _U, _U),
    "BindImageTexture": (None, _U, _U, _I, ctypes.c_ubyte, _I, _U, _U),
    "BindSampler": (None, _U, _U),
    "BindTexture": (None, _U, _U),
    "CheckFramebufferStatus": (_U, _U),
    "ClearBufferfv": (None, _U, _I, _P),
    "ClearBufferuiv": (None, _U, _I, _P),
    "ClearTexSubImage": (None, _U, *[_I] * 7, _U, _U, _P),
    "ClipControl": (None, _U, _U),
    "ColorMask": (None, _I, _I, _I, _I),
    "DebugMessageCallback": (None, _P, _P),
    "DeleteFramebuffers": (None, _I, _P),
    "DeleteQueries": (None, _I, _P),
    "DeleteSamplers": (None, _I, _P),
    "DeleteTextures": (None, _I, _P),
    "DepthMask": (None, ctypes.c_ubyte),
    "DrawBuffers": (None, _I, _P),
    "Flush": (None,),
    "FramebufferTexture": (None, _U, _U, _U, _I),
    "FramebufferTextureLayer": (None, _U, _U, _U, _I, _I),
    "GenerateMipmap": (None, _U),
    "GenFramebuffers": (None, _I, _P),
    "GenQueries": (None, _I, _P),
    "GenSamplers": (None, _I, _P),
    "GenTextures": (None, _I, _P),
    "GetError": (_U,),
    "GetIntegerv": (None, _U, _P),
    "GetQueryObjectui64v": (None, _U, _U, _P),
    "GetTexLevelParameteriv": (None, _U, _I, _U, _P),
    "GetTexImage": (None, _U, _I, _U, _U, _P),
    **{f"Is{kind}": (ctypes.c_ubyte, _U) for kind in KINDS},
    "MemoryBarrier": (None, _U),
    "PixelStorei": (None, _U, _I),
    "QueryCounter": (None, _U, _U),
    "ReadPixels": (None, _I, _I, _I, _I, _U, _U, _P),
    "SamplerParameteri": (None, _U, _U, _I),
    "Scissor": (None, _I, _I, _I, _I),
    "TexStorage2D": (None, _U, _I, _U, _I, _I),
    "TexStorage3D": (None, _U, _I, _U, _I, _I, _I),
    "TexSubImage2D": (None, _U, _I, _I, _I, _I, _I, _U, _U, _P),
    "TexSubImage3D": (None, _U, _I, _I, _I, _I, _I, _I, _I, _U, _U, _P),
    "Viewport": (None, _I, _I, _I, _I),
}

TEXTURE_2D, TEXTURE_2D_ARRAY, TEXTURE0 = 0x0DE1, 0x8C1A, 0x84C0
FRAMEBUFFER, FRAMEBUFFER_COMPLETE = 0x8D40, 0x8CD5
COLOR, DEPTH = 0x1800, 0x1801
COLOR_ATTACHMENT0, DEPTH_ATTACHMENT = 0x8CE0, 0x8D00
LOWER_LEFT, ZERO_TO_ONE = 0x8CA1, 0x935F
TIMESTAMP, QUERY_RESULT = 0x8E28, 0x8866
CLIP_DISTANCE0, SCISSOR_TEST = 0x3000, 0x0C11
MAX_TEXTURE_SIZE, MAX_ARRAY_LAYERS, MAX_VIEWPORT_DIMS = 0x0D33, 0x88FF, 0x0D3A
TEXTURE_WIDTH, TEXTURE_HEIGHT, TEXTURE_DEPTH = 0x1000, 0x1001, 0x8071
TEXTURE_BITS = 0x805C, 0x805D, 0x805E, 0x805F, 0x884A
"""Sizes of red, green, blue, alpha and depth."""
RGBA32F, RGBA16F, RGBA16, RGBA8, R32F = 0x8814, 0x881A, 0x805B, 0x8058, 0x822E
RGBA32UI, RG32UI, R32UI, DEPTH_COMPONENT32F = 0x8D70, 0x823C, 0x8236, 0x8CAC
RGBA, RGB, RED, DEPTH_COMPONENT, RGBA_INTEGER = 0x1908, 0x1907, 0x1903, 0x1902, 0x8D99
RG_INTEGER, RED_INTEGER = 0x8228, 0x8D94
FLOAT, UNSIGNED_BYTE, UNSIGNED_INT = 0x1406, 0x1401, 0x1405
PACK_ALIGNMENT, UNPACK_ALIGNMENT = 0x0D05, 0x0CF5
SAMPLERS = frozenset(
    {
        *(*range(0x8B5D, 0x8B65), *range(0x8DC0, 0x8DC6), *range(0x8DC9, 0x8DD9)),
        *(*range(0x900C, 0x9010), *range(0x9108, 0x910E)),
    }
)
"""Types of sampler uniforms: float, shadow, rectangle, buffer, array, signed, unsigned, cube array, multisampled."""
READ_WRITE = 0x88BA
WRAP = 0x2802, 0x2803
"""Names of the parameters for u and v."""
MAG_FILTER, MIN_FILTER, MAX_ANISOTROPY = 0x2800, 0x2801, 0x84FE
NEAREST, LINEAR = 0x2600, 0x2601
NEAREST_MIPMAP_NEAREST, LINEAR_MIPMAP_NEAREST, NEAREST_MIPMAP_LINEAR, LINEAR_MIPMAP_LINEAR = range(0x2700, 0x2704)
REPEAT, CLAMP_TO_EDGE, MIRRORED_REPEAT = 0x2901, 0x812F, 0x8370
TEXTURE_FETCH_BARRIER, IMAGE_ACCESS_BARRIER, TEXTURE_UPDATE_BARRIER, FRAMEBUFFER_BARRIER = 0x8, 0x20, 0x100, 0x400
OUT_OF_MEMORY, CONTEXT_LOST = 0x0505, 0x0507
DEBUG_OUTPUT, DEBUG_OUTPUT_SYNCHRONOUS, DEBUG_SOURCE_API = 0x92E0, 0x8242, 0x8246
DEBUG_FAULTS = 0x824C, 0x824D, 0x824E
"""Types of messages that are faults: errors, deprecated and undefined behaviour."""


class GL:
    """The functions of `_SIGNATURES` as attributes, each loaded when first used."""

    def __init__(self, loader: Loader) -> None:
        self._loader = loader
        self.debug: DebugOutput | None = None
        if sys.platform == "win32":
            self._type = ctypes.WINFUNCTYPE
        else:
            self._type = ctypes.CFUNCTYPE

    def __getattr__(self, name: str) -> Callable[..., Any]:
        result, *arguments = _SIGNATURES[name]
        address = self._loader.load(f"gl{name}")
        if not address:
            raise DeviceError(f"OpenGL: this driver has no gl{name}; update the driver, or use --device software")
        function: Callable[..., Any] = self._type(result, *arguments)(address)
        setattr(self, name, function)
        return function

    def debug_callback(self, function: Callable[..., None]) -> Any:
        """Convert `function` for DebugMessageCallback; hold a reference to the result as long as OpenGL may call it."""
        return self._type(None, _U, _U, _U, _U, _I, ctypes.c_char_p, _P)(function)

    def make(self, function: str) -> int:
        """Return a new name from GenTextures, GenSamplers, GenFramebuffers or GenQueries."""
        name = _U()
        getattr(self, function)(1, ctypes.byref(name))
        return name.value

    def delete(self, function: str, name: int) -> None:
        """Delete a name by DeleteTextures, DeleteSamplers, DeleteFramebuffers or DeleteQueries."""
        getattr(self, function)(1, ctypes.byref(_U(name)))

    def integers(self, what: int, count: int = 1) -> list[int]:
        """Return `count` values of glGetIntegerv."""
        values = (_I * count)()
        self.GetIntegerv(what, values)
        return list(values)

    def count_objects(self) -> dict[str, int]:
        """Count the context's objects of each of KINDS."""
        return {kind: sum(map(getattr(self, f"Is{kind}"), range(1, HIGHEST))) for kind in KINDS}

    def check(self, doing: str) -> None:
        """Raise DeviceError if OpenGL has an error pending: allocations fail silently otherwise."""
        error = self.GetError()
        if error:
            if self.debug:
                self.debug.faults.clear()  # raised here
            if error == CONTEXT_LOST:
                raise DeviceError(f"{doing}: the driver was reset and the context is lost; make another Renderer")
            kind = "out of memory" if error == OUT_OF_MEMORY else f"OpenGL error 0x{error:04x}"
            raise DeviceError(f"{doing}: {kind}; use a smaller size or fewer VPLs")
