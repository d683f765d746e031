"""What a machine has of what deferred-ir needs, and how to mend what is missing: `deferred-ir doctor` and `devices`."""

from __future__ import annotations

import importlib
import json
import os
import platform
import re
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path

from deferred_ir.base.errors import DeviceError
from deferred_ir.gl import devices

DISTRIBUTION = "deferred-ir"
OPTIONAL_FEATURES = {
    "GL_ARB_clip_control": "without it: fragment shaders write the depth, slower but as exact",
    "GL_ARB_shader_viewport_layer_array": "without it: a geometry shader picks the layer, slower",
}
VARIABLES = {
    "GLCONTEXT_DEVICE_INDEX": "--device auto follows it, any other --device overrules it",
    "GLCONTEXT_LINUX_LIBEGL": "used in place of libEGL.so.1",
    "GLCONTEXT_LINUX_LIBGL": "tried before libGL.so.1",
    "GLCONTEXT_GLVERSION": "ignored: 4.3 is asked for",
    "LIBGL_ALWAYS_SOFTWARE": "makes Mesa draw in software",
    "MESA_GL_VERSION_OVERRIDE": "changes the version that Mesa offers",
    "__EGL_VENDOR_LIBRARY_FILENAMES": "limits EGL to these drivers",
    "__EGL_VENDOR_LIBRARY_DIRS": "limits EGL to the drivers in these folders",
    "CUDA_VISIBLE_DEVICES": "does not reorder EGL devices: choose with --device cuda:N",
    "NVIDIA_DRIVER_CAPABILITIES": "in a container it must hold graphics, or be all",
}
_VENDOR_FOLDERS = ("/etc/glvnd/egl_vendor.d", "/usr/share/glvnd/egl_vendor.d")


@dataclass(frozen=True)
class Check:
    """One thing looked at.

    mend: what to do if it is not ok, or a remark. optional: it does not count against the machine.
    """

    name: str
    ok: bool
    found: str
    mend: str = ""
    optional: bool = False


def checks(device: str = "auto") -> list[Check]:
    """Looks at everything; never raises for what is missing. `device` is opened as `--device` would."""
    results = [_python(), *_packages(), _rays()]
    if sys.platform == "linux":
        results += [_library(), _vendors(), _listed()]
    return [*results, *_context(device), *_extras(), _display(), *_environment()]


def healthy(results: Sequence[Check]) -> bool:
    """Whether all that is required is there: exit status 0."""
    return all(check.ok or check.optional for check in results)


def report(results: Sequence[Check] | None = None) -> str:
    """The checks as a table, each fault followed by its mend, and a last line that says how it stands."""
    results = checks() if results is None else results
    width = max(len(check.name) for check in results)
    lines = []
    for check in results:
        mark = "ok" if check.ok else "-" if check.optional else "FAULT"
        fault = not (check.ok or check.optional)
        remark = f"; {check.mend}" if check.mend and not fault else ""
        lines.append(f"{mark:<6}{check.name:<{width}}  {check.found}{remark}")
        if fault:
            lines.append(f"{'':<{width + 8}}{check.mend}")
    faults = [check.name for check in results if not check.ok and not check.optional]
    lines.append("")
    lines.append(f"{len(faults)} to mend: {', '.join(faults)}" if faults else "All that is required is there.")
    return "\n".join(lines)


def devices_table() -> str:
    """All devices, with what OpenGL says of each once it is open; `*` marks the first choice of `--device auto`.

    Raises DeviceError if there is no EGL, or no driver, at all.
    """
    opened = [_opened(device) for device in devices.list_devices()] if sys.platform == "linux" else [_default()]
    if not opened:
        raise DeviceError(devices.NO_DRIVER)
    usable = [device for device, _, works in opened if works]
    usable.sort(key=lambda device: device.kind == "software")
    rows = [("", "DEVICE", "KIND", "CUDA", "FILE", "NAME", "OPENGL")]
    for device, version, _ in opened:
        cuda = "" if device.cuda is None else str(device.cuda)
        mark = "*" if device in usable[:1] else ""
        rows.append((mark, device.spec, device.kind, cuda, device.drm or "", device.name, version))
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    return "\n".join("  ".join(map(str.ljust, row, widths)).rstrip() for row in rows)


def _opened(device: devices.Device) -> tuple[devices.Device, str, bool]:
    """The device as its context names it, its OpenGL version or what is wrong, and whether it works."""
    try:
        context, loader, opened = devices.open_device(device)
    except DeviceError as error:
        return device, str(error).partition(": ")[2] or str(error), False
    version = context.info["GL_VERSION"]
    devices.close(context, loader)
    return opened, version, True


def _default() -> tuple[devices.Device, str, bool]:
    context, loader, device = devices.create_context()
    version = context.info["GL_VERSION"]
    devices.close(context, loader)
    return device, version, True


def _python() -> Check:
    found = f"{platform.python_version()} on {platform.platform(terse=True)} {platform.machine()}"
    return Check(
        "Python", sys.version_info >= (3, 11), found, "" if sys.version_info >= (3, 11) else "use 3.11 or newer"
    )


def _requirements() -> Iterator[tuple[str, str, str]]:
    """Name, least version and marker of each requirement, read from the installed package, which alone states them."""
    for line in metadata.requires(DISTRIBUTION) or []:
        requirement, _, marker = line.partition(";")
        name, _, least = requirement.partition(">=")
        yield name.strip(), least.strip(), marker.strip()


def _packages() -> list[Check]:
    """The required packages; embreex, which not every machine can have, is for `_rays`."""
    try:
        required = [(name, least) for name, least, marker in _requirements() if not marker]
    except metadata.PackageNotFoundError:
        return [Check(DISTRIBUTION, False, "not installed", "pip install .")]
    modules = {_plain(dist): module for module, dists in metadata.packages_distributions().items() for dist in dists}
    return [
        Check(DISTRIBUTION, True, metadata.version(DISTRIBUTION)),
        *(_package(name, least, modules.get(_plain(name), name)) for name, least in required),
    ]


def _package(name: str, least: str, module: str) -> Check:
    mend = f"pip install '{name}>={least}'"
    try:
        version = metadata.version(name)
    except metadata.PackageNotFoundError:
        return Check(name, False, "not installed", mend)
    if _numbers(version) < _numbers(least):
        return Check(name, False, f"{version}, {least} or newer is needed", mend)
    try:
        importlib.import_module(module)
    except Exception as error:  # a broken wheel can raise anything
        return Check(
            name, False, f"{version}, but its import fails: {error}", f"pip install --force-reinstall '{name}'"
        )
    return Check(name, True, version)


def _plain(name: str) -> str:
    """A distribution's name as indexes compare it."""
    return re.sub(r"[-_.]+", "-", name).lower()


def _numbers(version: str) -> list[int]:
    return [int(number) for number in re.findall(r"\d+", version)]


def _rays() -> Check:
    """Traces one ray."""
    try:
        from deferred_ir.rays.embree import traces_a_ray

        found = traces_a_ray()
    except (ImportError, DeviceError) as error:
        no_wheel = platform.system() == "Linux" and platform.machine() == "aarch64"
        mend = "no wheel for Linux arm64: render with --vpls 0" if no_wheel else "pip install 'embreex>=4.4'"
        return Check("embreex", False, str(error.__cause__ or error), mend, optional=no_wheel)
    if not found:
        return Check("embreex", False, "a test ray missed", "pip install --force-reinstall embreex")
    return Check("embreex", True, f"{metadata.version('embreex')}, traces rays")


def _library() -> Check:
    fault = devices.load_fault(devices.libegl())
    return Check("EGL library", not fault, fault or devices.libegl(), devices.INSTALL if fault else "")


def _vendors() -> Check:
    """The drivers that EGL knows by their files; some systems do without such files."""
    files = os.environ.get("__EGL_VENDOR_LIBRARY_FILENAMES", "").split(":")
    folders = os.environ.get("__EGL_VENDOR_LIBRARY_DIRS", ":".join(_VENDOR_FOLDERS)).split(":")
    paths = [Path(file) for file in files if file] or [path for f in folders for path in sorted(Path(f).glob("*.json"))]
    found, broken = [], []
    for path in paths:
        try:
            library = json.loads(path.read_text())["ICD"]["library_path"]
        except (OSError, ValueError, KeyError) as error:
            broken.append(f"{path}: {error}")
            continue
        fault = devices.load_fault(library)
        if fault:
            broken.append(f"{path.name} ({fault})")
        else:
            found.append(f"{path.name} ({library})")
    ok = bool(found) and not broken
    return Check("EGL drivers", ok, "; ".join(found + broken) or "none", "" if ok else devices.INSTALL, optional=True)


def _listed() -> Check:
    try:
        found = devices.list_devices()
    except DeviceError as error:
        what, _, mend = str(error).partition("; ")
        return Check("devices", False, what, mend)
    mend = ""
    if not any(device.kind == "hardware" for device in found):
        mend = _hidden_hardware()
    return Check(
        "devices", bool(found), ", ".join(map(str, found)) or "none", mend or ("" if found else devices.INSTALL)
    )


def _hidden_hardware() -> str:
    """Why a graphics card that is there may be missing from EGL's list."""
    if Path("/dev/nvidiactl").exists():
        return "an NVIDIA GPU is there but not its OpenGL: in a container set NVIDIA_DRIVER_CAPABILITIES=all"
    closed = [node for node in Path("/dev/dri").glob("renderD*") if not os.access(node, os.R_OK | os.W_OK)]
    if closed:
        return f"{closed[0]} is closed to this user: add the user to the groups video and render"
    return ""


def _context(device: str) -> list[Check]:
    name = f"context ({device})"
    try:
        context, loader, opened = devices.create_context(device)
    except ImportError as error:
        return [Check(name, False, str(error), "install the packages above")]
    except DeviceError as error:
        found, _, mend = str(error).rpartition("; ")
        return [Check(name, False, found, mend)]
    extensions, info, code = context.extensions, context.info, context.version_code
    devices.close(context, loader)
    enough = code >= devices.FLOOR
    return [
        Check(name, True, str(opened), "correct, but slow" if opened.kind == "software" else ""),
        Check("OpenGL 4.3", enough, info["GL_VERSION"], "" if enough else "update the driver"),
        *(
            Check(feature, feature in extensions, "yes" if feature in extensions else fallback, optional=True)
            for feature, fallback in OPTIONAL_FEATURES.items()
        ),
    ]


def _extras() -> list[Check]:
    """The packages of the extras, apart from those for work on deferred-ir itself."""
    try:
        requirements = list(_requirements())
    except metadata.PackageNotFoundError:
        return []
    results = []
    for name, _, marker in requirements:
        extra = re.search(r"extra == ['\"](\w+)['\"]", marker)
        if not extra or extra[1] == "dev":
            continue
        try:
            results.append(Check(name, True, metadata.version(name), optional=True))
        except metadata.PackageNotFoundError:
            mend = f"pip install 'deferred-ir[{extra[1]}]'"
            results.append(Check(name, False, f"not installed; only for {extra[1]}", mend, optional=True))
    return results


def _display() -> Check:
    """Whether a window could open, for the viewer; everything else works without."""
    name = "display"
    if sys.platform == "linux" and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        return Check(name, False, "none; only the viewer needs one", "set DISPLAY, or use xvfb-run", optional=True)
    try:
        from deferred_ir.gl.window import display_opens

        opens = display_opens()
    except ImportError as error:
        return Check(name, False, str(error), "pip install glfw", optional=True)
    if not opens:
        return Check(name, False, "GLFW cannot reach it", "check DISPLAY; only the viewer needs one", optional=True)
    return Check(name, True, f"GLFW {metadata.version('glfw')}", optional=True)


def _environment() -> list[Check]:
    """Environment variables that change what the above finds."""
    return [
        Check(variable, True, os.environ[variable], meaning, optional=True)
        for variable, meaning in VARIABLES.items()
        if os.environ.get(variable)
    ]
