"""What a machine has of what deferred-ir needs, and how to mend what is missing: the checks of `deferred-ir doctor`."""

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
from deferred_ir.gl import devices, egl

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
    """The result of one check.

    mend: what to do if it is not ok, or a remark. optional: it does not count against the machine.
    """

    name: str
    ok: bool
    found: str
    mend: str = ""
    optional: bool = False


def run_checks(device: str = "auto") -> list[Check]:
    """Check everything, with the device that `--device` would open; never raises for what is missing."""
    results = [_check_python(), *_check_packages(), _check_rays()]
    if sys.platform == "linux":
        results += [_check_library(), _check_vendors(), _check_devices()]
    return [*results, *_check_context(device), *_check_extras(), _check_display(), *_list_variables()]


def is_healthy(results: Sequence[Check]) -> bool:
    """Return whether everything required is there."""
    return all(check.ok or check.optional for check in results)


def format_report(results: Sequence[Check]) -> str:
    """Lay out the checks as a table, each fault followed by its mend, and a last line with the faults."""
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


def _check_python() -> Check:
    found = f"{platform.python_version()} on {platform.platform(terse=True)} {platform.machine()}"
    return Check(
        "Python", sys.version_info >= (3, 11), found, "" if sys.version_info >= (3, 11) else "use 3.11 or newer"
    )


def _list_requirements() -> Iterator[tuple[str, str, str]]:
    """Yield name, least version and marker of each requirement of the installed package."""
    for line in metadata.requires(DISTRIBUTION) or []:
        requirement, _, marker = line.partition(";")
        name, _, least = requirement.partition(">=")
        yield name.strip(), least.strip(), marker.strip()


def _check_packages() -> list[Check]:
    """Check the required packages apart from embreex, which not every machine can have: `_check_rays` does that."""
    try:
        required = [(name, least) for name, least, marker in _list_requirements() if not marker]
    except metadata.PackageNotFoundError:
        return [Check(DISTRIBUTION, False, "not installed", "pip install .")]
    modules = {
        _normalise(dist): module for module, dists in metadata.packages_distributions().items() for dist in dists
    }
    return [
        Check(DISTRIBUTION, True, metadata.version(DISTRIBUTION)),
        *(_check_package(name, least, modules.get(_normalise(name), name)) for name, least in required),
    ]


def _check_package(name: str, least: str, module: str) -> Check:
    mend = f"pip install '{name}>={least}'"
    try:
        version = metadata.version(name)
    except metadata.PackageNotFoundError:
        return Check(name, False, "not installed", mend)
    if _split_version(version) < _split_version(least):
        return Check(name, False, f"{version}, {least} or newer is needed", mend)
    try:
        importlib.import_module(module)
    except Exception as error:  # a broken wheel can raise anything
        return Check(
            name, False, f"{version}, but its import fails: {error}", f"pip install --force-reinstall '{name}'"
        )
    return Check(name, True, version)


def _normalise(name: str) -> str:
    """Return a distribution's name as package indexes compare it."""
    return re.sub(r"[-_.]+", "-", name).lower()


def _split_version(version: str) -> list[int]:
    return [int(number) for number in re.findall(r"\d+", version)]


def _check_rays() -> Check:
    """Trace one ray."""
    try:
        from deferred_ir.rays.embree import can_trace

        found = can_trace()
    except (ImportError, DeviceError) as error:
        no_wheel = platform.system() == "Linux" and platform.machine() == "aarch64"
        mend = "no wheel for Linux arm64: render with --vpls 0" if no_wheel else "pip install 'embreex>=4.4'"
        return Check("embreex", False, str(error.__cause__ or error), mend, optional=no_wheel)
    if not found:
        return Check("embreex", False, "a test ray missed", "pip install --force-reinstall embreex")
    return Check("embreex", True, f"{metadata.version('embreex')}, traces rays")


def _check_library() -> Check:
    fault = egl.load_fault(egl.libegl())
    return Check("EGL library", not fault, fault or egl.libegl(), egl.INSTALL if fault else "")


def _check_vendors() -> Check:
    """Check the files through which EGL finds its drivers; some systems do without them."""
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
        fault = egl.load_fault(library)
        if fault:
            broken.append(f"{path.name} ({fault})")
        else:
            found.append(f"{path.name} ({library})")
    ok = bool(found) and not broken
    return Check("EGL drivers", ok, "; ".join(found + broken) or "none", "" if ok else egl.INSTALL, optional=True)


def _check_devices() -> Check:
    try:
        found = egl.list_devices()
    except DeviceError as error:
        what, _, mend = str(error).partition("; ")
        return Check("devices", False, what, mend)
    mend = ""
    if not any(device.kind == "hardware" for device in found):
        mend = _explain_missing_hardware()
    return Check("devices", bool(found), ", ".join(map(str, found)) or "none", mend or ("" if found else egl.INSTALL))


def _explain_missing_hardware() -> str:
    """Return why EGL may not list a graphics card that is there, "" if nothing is known."""
    if Path("/dev/nvidiactl").exists():
        return "an NVIDIA GPU is there but not its OpenGL: in a container set NVIDIA_DRIVER_CAPABILITIES=all"
    closed = [node for node in Path("/dev/dri").glob("renderD*") if not os.access(node, os.R_OK | os.W_OK)]
    if closed:
        return f"{closed[0]} is closed to this user: add the user to the groups video and render"
    return ""


def _check_context(device: str) -> list[Check]:
    name = f"context ({device})"
    try:
        context, loader, opened = devices.create_context(device)
    except ImportError as error:
        return [Check(name, False, str(error), "install the packages above")]
    except DeviceError as error:
        found, _, mend = str(error).rpartition("; ")
        return [Check(name, False, found, mend)]
    extensions, info, code = context.extensions, context.info, context.version_code
    driver = opened.name, info["GL_VERSION"]
    devices.close(context, loader)
    enough = code >= devices.FLOOR
    return [
        Check(name, True, str(opened), "correct, but slow" if opened.kind == "software" else ""),
        Check("OpenGL 4.3", enough, info["GL_VERSION"], "" if enough else "update the driver"),
        *(
            Check(feature, feature in extensions, "yes" if feature in extensions else fallback, optional=True)
            for feature, fallback in OPTIONAL_FEATURES.items()
        ),
        _check_costs(*driver),
        _check_stages(*driver),
    ]


def _check_costs(device: str, opengl: str) -> Check:
    """Look for what frames cost with this driver, which `render --within` starts from."""
    from deferred_ir.tuning import machine_costs

    machine = machine_costs.describe_machine(device, opengl)
    costs, anew = machine_costs.read(machine), "`deferred-ir doctor --calibrate` measures"
    if costs is None:
        return Check(
            "costs of frames", False, f"not known; render --within measures them first, {anew} now", optional=True
        )
    slowest = max(costs.ms[-1])
    found = f"measured {costs.measured}, up to {slowest:.0f} ms, kept in {machine_costs.find_file(machine)}"
    return Check("costs of frames", True, found, f"{anew} anew", optional=True)


def _check_stages(device: str, opengl: str) -> Check:
    """Look for the passes that were tried in compute shaders with this driver."""
    from deferred_ir.tuning import cache, stage_costs

    name, costs = "compute shaders", stage_costs.read(cache.name_machine(device, opengl))
    if costs is None:
        return Check(name, False, "not tried; `deferred-ir doctor --calibrate` does", optional=True)
    trials = "; ".join(f"{kind.rpartition('.')[2]} {trial}" for kind, trial in costs.passes.items())
    return Check(name, True, trials, f"tried {costs.measured}", optional=True)


def _check_extras() -> list[Check]:
    """Look for the packages of the extras, apart from those for work on deferred-ir itself."""
    try:
        requirements = list(_list_requirements())
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


def _check_display() -> Check:
    """Try to reach a display, which only the viewer needs."""
    name = "display"
    if sys.platform == "linux" and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        return Check(name, False, "none; only the viewer needs one", "set DISPLAY, or use xvfb-run", optional=True)
    try:
        from deferred_ir.gl.window import can_open_display

        opens = can_open_display()
    except ImportError as error:
        return Check(name, False, str(error), "pip install glfw", optional=True)
    if not opens:
        return Check(name, False, "GLFW cannot reach it", "check DISPLAY; only the viewer needs one", optional=True)
    return Check(name, True, f"GLFW {metadata.version('glfw')}", optional=True)


def _list_variables() -> list[Check]:
    """List the environment variables that change what the checks find."""
    return [
        Check(variable, True, os.environ[variable], meaning, optional=True)
        for variable, meaning in VARIABLES.items()
        if os.environ.get(variable)
    ]
