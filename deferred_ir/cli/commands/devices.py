"""`deferred-ir devices`: what OpenGL can run on here."""

from __future__ import annotations

import argparse
import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from deferred_ir.gl.egl import Device

HELP = "List the devices that OpenGL can run on."
ORDER = 100


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add nothing: the command has no options."""


def run(arguments: argparse.Namespace) -> int:
    """Print the table of devices."""
    del arguments
    print(format_devices())
    return 0


def format_devices() -> str:
    """Lay out all devices as a table, with what OpenGL says of each; `*` marks the first choice of `--device auto`.

    Raises DeviceError if there is no EGL, or no driver, at all.
    """
    from deferred_ir.base.errors import DeviceError
    from deferred_ir.gl import egl

    opened = [_try(device) for device in egl.list_devices()] if sys.platform == "linux" else [_open_default()]
    if not opened:
        raise DeviceError(egl.NO_DRIVER)
    usable = [device for device, _, works in opened if works]
    usable.sort(key=lambda device: device.kind == "software")
    rows = [("", "DEVICE", "KIND", "CUDA", "FILE", "NAME", "OPENGL")]
    for device, version, _ in opened:
        cuda = "" if device.cuda is None else str(device.cuda)
        mark = "*" if device in usable[:1] else ""
        rows.append((mark, device.spec, device.kind, cuda, device.drm or "", device.name, version))
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    return "\n".join("  ".join(map(str.ljust, row, widths)).rstrip() for row in rows)


def _try(device: Device) -> tuple[Device, str, bool]:
    """Open a device. Returns it with its OpenGL's own name, its OpenGL version or the fault, and whether it works."""
    from deferred_ir.base.errors import DeviceError
    from deferred_ir.gl import devices

    try:
        context, loader, opened = devices.open_device(device)
    except DeviceError as error:
        return device, str(error).partition(": ")[2] or str(error), False
    version = context.info["GL_VERSION"]
    devices.close(context, loader)
    return opened, version, True


def _open_default() -> tuple[Device, str, bool]:
    """Open the only device of a system without EGL. Returns what `_try` does; raises DeviceError if it cannot."""
    from deferred_ir.gl import devices

    context, loader, device = devices.create_context()
    version = context.info["GL_VERSION"]
    devices.close(context, loader)
    return device, version, True
