"""Chooses a device by what `--device` says, and opens an OpenGL context on it.

Contexts come from glcontext. Its loader is returned with each, because the rest of this package calls OpenGL functions
that moderngl does not have.
"""

from __future__ import annotations

import logging
import os
import re
import sys
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Literal, Protocol

from deferred_ir.base.errors import DeviceError, did_you_mean
from deferred_ir.gl.egl import INSTALL, NO_DRIVER, Device, libegl, list_devices

if TYPE_CHECKING:
    import moderngl

log = logging.getLogger("deferred_ir")

FLOOR = 430
"""The least OpenGL version that the shaders run on, as moderngl writes it."""

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
    """A glcontext object, which knows the addresses of OpenGL functions."""

    def load(self, name: str) -> int:
        """Return the address of the function `name`, 0 if there is none."""


def create_context(device: str = "auto") -> tuple[moderngl.Context, Loader, Device]:
    """Open a headless OpenGL 4.3 core context, current in this thread. Returns it, its function loader and its device.

    device: `auto` (the first hardware device that gives a context, else software), `software`, `egl:N`, `cuda:N`,
    or part of a device's name. `auto` follows GLCONTEXT_DEVICE_INDEX; any other choice overrules it.
    Raises DeviceError (one line, with the mend) where there is no such device or it cannot do 4.3.
    """
    if not device.strip():
        raise DeviceError("device '': names none; take auto, or one that `deferred-ir devices` lists")
    if sys.platform == "win32":
        return _log_choice(*_create_default())
    if sys.platform == "darwin":
        raise DeviceError("device: macOS offers OpenGL 4.1, and 4.3 is needed; run in a Linux container or machine")
    devices = list_devices()
    if not devices:
        raise DeviceError(NO_DRIVER)
    index = os.environ.get("GLCONTEXT_DEVICE_INDEX")
    if device == "auto" and index:
        device = f"egl:{index}"
    if device == "auto":
        return _log_choice(*_create_auto(devices))
    candidates = _match(device, devices)
    if candidates:
        return _log_choice(*open_device(candidates[0]))
    return _log_choice(*_create_by_renderer(device, devices))


def _log_choice(context: moderngl.Context, loader: Loader, device: Device) -> tuple[moderngl.Context, Loader, Device]:
    log.info("OpenGL %s on %s", context.info["GL_VERSION"], device)
    return context, loader, device


def _match(wanted: str, devices: list[Device]) -> list[Device]:
    """Return the devices that `wanted` names by number, kind or listed name; [] for a name that EGL does not list."""
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
    """Open the first device that works, hardware before software.

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
    """Open the first device whose GL_RENDERER contains `wanted`; many drivers tell it only once a context is open."""
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
    """Open a context on exactly this device. The returned Device has GL_RENDERER as its name."""
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
    """Open a context on the system's default device, where there is no EGL (Windows)."""
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
    """Return the current context, that of a window, as `create_context` does. Raises DeviceError below OpenGL 4.3."""
    import moderngl

    opened: Any = window  # moderngl's annotation knows only dictionaries, its code such objects
    try:
        context = moderngl.create_context(context=opened, require=FLOOR)
    except Exception as error:  # moderngl raises plain Exception
        raise DeviceError(f"device: no OpenGL 4.3 in the window ({error}); update the graphics driver") from error
    name = context.info["GL_RENDERER"]
    kind: Literal["hardware", "software"] = "software" if _SOFTWARE_NAMES.search(name) else "hardware"
    return _log_choice(context, window, Device(0, kind, name, None, None, "window"))


def close(context: moderngl.Context, loader: Any) -> None:
    """Destroy a context. It is unbound first, because EGL keeps one that is current."""
    context.release()
    loader.__exit__(None, None, None)
    loader.release()
