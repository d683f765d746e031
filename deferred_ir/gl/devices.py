"""Which OpenGL devices there are, and a headless context on one of them.

EGL lists the devices; each gets a name that `--device` accepts. Contexts come from glcontext, whose loader is kept,
because the rest of this package calls OpenGL functions that moderngl does not have.

CUDA_VISIBLE_DEVICES does not reorder EGL devices: choose by `cuda:N`, which asks the driver for the mapping.
"""

from __future__ import annotations

import ctypes
import logging
import os
import re
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal, Protocol

from deferred_ir.base.errors import DeviceError, did_you_mean

if TYPE_CHECKING:
    import moderngl

log = logging.getLogger("deferred_ir")

FLOOR = 430
"""The least OpenGL version that the shaders run on, as moderngl writes it."""
INSTALL = "apt install libegl1 libgl1-mesa-dri"
"""The mend where a system has no OpenGL at all."""
NO_DRIVER = (
    f"device: EGL finds no driver; {INSTALL}, or in a container with an NVIDIA GPU set NVIDIA_DRIVER_CAPABILITIES=all"
)

_EXTENSIONS = 0x3055
_DRM_FILE = 0x3233
_RENDERER = 0x335F
_CUDA = 0x323A
_SOFTWARE_NAMES = re.compile(r"llvmpipe|softpipe|swrast|swiftshader|software", re.IGNORECASE)

_MENDS = (
    ("not loaded", f"install it: {INSTALL}"),
    (
        "0x3001",
        "the driver refuses the device: add the user to the groups video and render, or in a container pass the "
        "device in (--gpus all with NVIDIA_DRIVER_CAPABILITIES=all, or --device /dev/dri)",
    ),
    ("0x3003", "the device is out of memory: close other programs that use it"),
    ("", "update the driver, or choose another device; `deferred-ir devices` lists them"),
)


class Loader(Protocol):
    """What a glcontext object offers: the addresses of OpenGL functions."""

    def load(self, name: str) -> int:
        """Address of the function `name`, 0 if there is none."""


@dataclass(frozen=True)
class Device:
    """One device that OpenGL can run on.

    index: its place in EGL's list. name: GL_RENDERER once a context is open, before that what EGL tells.
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
    """File name of the EGL library. A soname, because the plain name exists only in -dev packages."""
    return os.environ.get("GLCONTEXT_LINUX_LIBEGL") or "libEGL.so.1"


def load_fault(library: str) -> str:
    """Why a shared library cannot be loaded, "" if it can."""
    try:
        ctypes.CDLL(library)
    except OSError as error:
        return str(error)
    return ""


def list_devices() -> list[Device]:
    """All EGL devices, in EGL's order. Raises DeviceError if EGL or its device extensions are missing."""
    # Mesa warns on stderr of each device that fails, which `auto` passes over; our own errors tell it all.
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


def create_context(device: str = "auto") -> tuple[moderngl.Context, Loader, Device]:
    """A headless OpenGL 4.3 core context, current in this thread; also its function loader, and where it runs.

    device: `auto` (the first hardware device that gives a context, else software), `software`, `egl:N`, `cuda:N`,
    or part of a device's name. `auto` follows GLCONTEXT_DEVICE_INDEX; any other choice overrules it.
    Raises DeviceError (one line, with the mend) where there is no such device or it cannot do 4.3.
    """
    if not device.strip():
        raise DeviceError("device '': names none; take auto, or one that `deferred-ir devices` lists")
    if sys.platform == "win32":
        return _chosen(*_create_default())
    if sys.platform == "darwin":
        raise DeviceError("device: macOS offers OpenGL 4.1, and 4.3 is needed; run in a Linux container or machine")
    devices = list_devices()
    if not devices:
        raise DeviceError(NO_DRIVER)
    index = os.environ.get("GLCONTEXT_DEVICE_INDEX")
    if device == "auto" and index:
        device = f"egl:{index}"
    if device == "auto":
        return _chosen(*_create_auto(devices))
    candidates = _matching(device, devices)
    if candidates:
        return _chosen(*open_device(candidates[0]))
    return _chosen(*_create_by_renderer(device, devices))


def _chosen(context: moderngl.Context, loader: Loader, device: Device) -> tuple[moderngl.Context, Loader, Device]:
    log.info("OpenGL %s on %s", context.info["GL_VERSION"], device)
    return context, loader, device


def _matching(wanted: str, devices: list[Device]) -> list[Device]:
    """The devices that `wanted` names by number, kind or listed name; [] for a name that no listing holds."""
    if wanted == "software":
        found = [device for device in devices if device.kind == "software"]
        if not found:
            raise DeviceError("device 'software': EGL lists no software rasteriser; apt install libgl1-mesa-dri")
        return found
    numbered = re.fullmatch(r"(egl|cuda):(.*)", wanted)
    if not numbered:
        return [device for device in devices if wanted.lower() in device.name.lower()]
    kind, number = numbered.groups()
    listed = {str(device.cuda if kind == "cuda" else device.index): device for device in devices}
    listed.pop("None", None)
    if number not in listed:
        known = ", ".join(f"{kind}:{key}" for key in listed) or f"no {kind} device"
        raise DeviceError(f"device '{wanted}': not listed; there is {known}; `deferred-ir devices` lists all")
    return [listed[number]]


def _create_auto(devices: list[Device]) -> tuple[moderngl.Context, Loader, Device]:
    """The first device that works, hardware before software.

    A device that EGL lists as hardware may still be drawn in software (a card without its driver): it comes second.
    """
    failures: list[str] = []
    disguised: list[Device] = []
    for device in sorted(devices, key=lambda device: device.kind == "software"):
        try:
            context, loader, opened = open_device(device)
        except DeviceError as error:
            failures.append(str(error))
            continue
        if opened.kind == device.kind:
            return context, loader, opened
        close(context, loader)
        disguised.append(device)
    if disguised:
        return open_device(disguised[0])
    raise DeviceError(" | ".join(failures))


def _create_by_renderer(wanted: str, devices: list[Device]) -> tuple[moderngl.Context, Loader, Device]:
    """The first device whose GL_RENDERER holds `wanted`; many drivers tell it only once a context is open."""
    names = {device.spec for device in devices} | {"auto", "software"}
    for device in devices:
        try:
            context, loader, opened = open_device(device)
        except DeviceError as error:
            log.info("%s", error)
            continue
        if wanted.lower() in opened.name.lower():
            return context, loader, opened
        names.add(opened.name)
        close(context, loader)
    raise DeviceError(f"device '{wanted}': no such device{did_you_mean(wanted, names)}")


def open_device(device: Device) -> tuple[moderngl.Context, Loader, Device]:
    """A context on exactly this device; the returned Device has GL_RENDERER as its name."""
    try:
        return _open(device, FLOOR)
    except DeviceError as error:
        if "0x3009" not in str(error):
            raise
    # The driver refuses 4.3: ask for less, only to tell the user what it has.
    context, loader, found = _open(device, 330)
    version = context.info["GL_VERSION"]
    close(context, loader)
    raise DeviceError(
        f"device '{device.spec}': {found.name} offers OpenGL {version}, and 4.3 core is needed; "
        + ("update Mesa" if found.kind == "software" else "update the driver, or use --device software")
    )


def _open(device: Device, version: int) -> tuple[moderngl.Context, Loader, Device]:
    import moderngl

    # glcontext's front door lets environment variables overrule its arguments; the module behind it does as told.
    from glcontext import egl

    failures: list[Exception] = []
    # libEGL hands out OpenGL functions, too, so that neither libGL nor X11 is needed; old ones do not.
    for libgl in dict.fromkeys((os.environ.get("GLCONTEXT_LINUX_LIBGL") or libegl(), "libGL.so.1", "libOpenGL.so.0")):
        try:
            loader = egl.create_context(
                mode="standalone", glversion=version, libgl=libgl, libegl=libegl(), device_index=device.index
            )
        except Exception as error:  # glcontext raises plain Exception
            if "not loaded" not in str(error):
                failures = [error]
                break
            failures.append(error)
            continue
        try:
            context = moderngl.create_context(context=loader)
        except Exception as error:  # as moderngl does, for functions that this libgl does not hand out
            failures.append(error)
            continue
        name = context.info["GL_RENDERER"]
        kind: Literal["hardware", "software"] = (
            "software" if device.kind == "software" or _SOFTWARE_NAMES.search(name) else "hardware"
        )
        return context, loader, replace(device, name=name, kind=kind)
    failure = failures[0]
    if device.kind == "software" and "0x3001" in str(failure):
        mend = "its driver is missing: apt install libgl1-mesa-dri"
    else:
        mend = next(mend for sign, mend in _MENDS if sign in str(failure))
    raise DeviceError(f"device '{device.spec}' ({device.name}): {failure}; {mend}") from failure


def _create_default() -> tuple[moderngl.Context, Loader, Device]:
    """The context of the system's default device, where there is no EGL (Windows)."""
    import glcontext
    import moderngl

    try:
        loader = glcontext.default_backend()(mode="standalone", glversion=FLOOR)
        context = moderngl.create_context(context=loader, require=FLOOR)
    except Exception as error:  # both libraries raise plain Exception
        raise DeviceError(f"device: no OpenGL 4.3 context ({error}); update the graphics driver") from error
    name = context.info["GL_RENDERER"]
    return context, loader, Device(0, "hardware", name, None, None, "default")


def adopt(window: Loader) -> tuple[moderngl.Context, Loader, Device]:
    """The context of a window, which is current: as `create_context` gives a headless one. DeviceError below 4.3."""
    import moderngl

    opened: Any = window  # moderngl's annotation knows only dictionaries, its code such objects
    try:
        context = moderngl.create_context(context=opened, require=FLOOR)
    except Exception as error:  # moderngl raises plain Exception
        raise DeviceError(f"device: no OpenGL 4.3 in the window ({error}); update the graphics driver") from error
    name = context.info["GL_RENDERER"]
    kind: Literal["hardware", "software"] = "software" if _SOFTWARE_NAMES.search(name) else "hardware"
    return _chosen(context, window, Device(0, kind, name, None, None, "window"))


def close(context: moderngl.Context, loader: Any) -> None:
    """Destroy a context; unbound first, for EGL keeps one that is current."""
    context.release()
    loader.__exit__(None, None, None)
    loader.release()
