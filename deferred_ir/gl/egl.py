"""Lists the devices that EGL knows; each gets a name that `--device` accepts.

CUDA_VISIBLE_DEVICES does not reorder EGL devices: choose by `cuda:N`, which asks the driver for the mapping.
"""

from __future__ import annotations

import ctypes
import os
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

from deferred_ir.base.errors import DeviceError

INSTALL = "apt install libegl1 libgl1-mesa-dri"
"""What to do where a system has no OpenGL at all."""
NO_DRIVER = (
    f"device: EGL finds no driver; {INSTALL}, or in a container with an NVIDIA GPU set NVIDIA_DRIVER_CAPABILITIES=all"
)

_EXTENSIONS = 0x3055
_DRM_FILE = 0x3233
_RENDERER = 0x335F
_CUDA = 0x323A


@dataclass(frozen=True)
class Device:
    """A device that OpenGL can run on.

    index: its place in EGL's list. name: GL_RENDERER once a context is open, before that what EGL calls it.
    drm: its device file, if any. cuda: CUDA's number for it, if any. spec: what `--device` takes, as `egl:0`.
    """

    index: int
    kind: Literal["hardware", "software"]
    name: str
    drm: str | None
    cuda: int | None
    spec: str

    def __str__(self) -> str:
        return f"{self.name} ({self.spec}, {self.kind})"


def libegl() -> str:
    """Return the file name of the EGL library: a soname, because the plain name exists only in -dev packages."""
    return os.environ.get("GLCONTEXT_LINUX_LIBEGL") or "libEGL.so.1"


def load_fault(library: str) -> str:
    """Return why a shared library cannot be loaded, "" if it can."""
    try:
        ctypes.CDLL(library)
    except OSError as error:
        return str(error)
    return ""


def list_devices() -> list[Device]:
    """Return all EGL devices, in EGL's order. Raises DeviceError if EGL or its device extensions are missing."""
    # Mesa warns on stderr of each device that fails, which `auto` passes over; our own errors say more.
    os.environ.setdefault("EGL_LOG_LEVEL", "fatal")
    try:
        egl = ctypes.CDLL(libegl())
    except OSError as error:
        raise DeviceError(f"device: {libegl()} cannot be loaded ({error}); install it: {INSTALL}") from error
    query_devices = _function(egl, "eglQueryDevicesEXT", ctypes.c_uint, ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p)
    query_string = _function(egl, "eglQueryDeviceStringEXT", ctypes.c_char_p, ctypes.c_void_p, ctypes.c_int)
    query_number = _function(
        egl, "eglQueryDeviceAttribEXT", ctypes.c_uint, ctypes.c_void_p, ctypes.c_int, ctypes.c_void_p
    )
    count = ctypes.c_int()
    query_devices(0, None, ctypes.byref(count))
    handles = (ctypes.c_void_p * count.value)()
    query_devices(count.value, handles, ctypes.byref(count))

    def text(handle: int, name: int) -> str | None:
        value = query_string(handle, name)
        return value.decode(errors="replace") if value else None

    def describe(index: int, handle: int) -> Device:
        extensions = (text(handle, _EXTENSIONS) or "").split()
        software = "EGL_MESA_device_software" in extensions
        drm = text(handle, _DRM_FILE) if "EGL_EXT_device_drm" in extensions else None
        number = ctypes.c_ssize_t(-1)
        if "EGL_NV_device_cuda" in extensions:
            query_number(handle, _CUDA, ctypes.byref(number))
        cuda = number.value if number.value >= 0 else None
        name = text(handle, _RENDERER) if "EGL_EXT_device_query_name" in extensions else None
        fallback = "software rasteriser" if software else "NVIDIA GPU" if cuda is not None else drm or "GPU"
        return Device(index, "software" if software else "hardware", name or fallback, drm, cuda, f"egl:{index}")

    return [describe(index, handle) for index, handle in enumerate(handles[: count.value]) if handle]


def _function(egl: ctypes.CDLL, name: str, result: Any, *arguments: Any) -> Callable[..., Any]:
    get = egl.eglGetProcAddress
    get.restype, get.argtypes = ctypes.c_void_p, [ctypes.c_char_p]
    address = get(name.encode())
    if not address:
        raise DeviceError(NO_DRIVER)
    return ctypes.CFUNCTYPE(result, *arguments)(address)
