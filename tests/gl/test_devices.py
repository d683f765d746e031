"""Which device is chosen, and that every way it can fail is one line with its mend."""

import logging
import os
import subprocess
import sys

import pytest

from deferred_ir.base.errors import DeviceError
from deferred_ir.gl import devices
from deferred_ir.gl.egl import Device

GPU = Device(0, "hardware", "NVIDIA GPU", "/dev/dri/card0", 1, "egl:0")
OTHER_GPU = Device(1, "hardware", "NVIDIA GPU", "/dev/dri/card1", 0, "egl:1")
SOFTWARE = Device(2, "software", "software rasteriser", None, None, "egl:2")
RENDERERS = {"egl:0": "Quadro A", "egl:1": "Quadro B", "egl:2": "llvmpipe"}


class Context:
    info = {"GL_VERSION": "4.6"}  # noqa: RUF012


@pytest.fixture
def machine(monkeypatch):
    """A pretended machine: set `.devices`, `.broken` (specs) and `.disguised` (drawn in software); see `.opened`."""

    class Machine:
        devices = [GPU, OTHER_GPU, SOFTWARE]  # noqa: RUF012
        broken = ()
        disguised = ()

        def __init__(self):
            self.opened, self.closed = [], 0

        def open(self, device):
            self.opened.append(device.spec)
            if device.spec in self.broken:
                raise DeviceError(f"device '{device.spec}': eglInitialize failed (0x3001); mend it")
            kind = "software" if device.spec in self.disguised else device.kind
            name = RENDERERS[device.spec]
            return Context(), self, Device(device.index, kind, name, device.drm, device.cuda, device.spec)

        def close(self, context, loader):
            self.closed += 1

    machine = Machine()
    monkeypatch.delenv("GLCONTEXT_DEVICE_INDEX", raising=False)
    monkeypatch.setattr(devices, "list_devices", lambda: list(machine.devices))
    monkeypatch.setattr(devices, "open_device", machine.open)
    monkeypatch.setattr(devices, "close", machine.close)
    return machine


def chosen(wanted="auto"):
    return devices.create_context(wanted)[2].spec


def test_auto_takes_the_first_hardware_device(machine):
    machine.devices = [SOFTWARE, OTHER_GPU, GPU]
    assert chosen() == "egl:1"


def test_auto_tries_the_next_device_after_a_failure(machine):
    machine.broken = ("egl:0",)
    assert chosen() == "egl:1"
    machine.broken = ("egl:0", "egl:1")
    assert chosen() == "egl:2"


def test_auto_prefers_real_hardware_to_a_card_without_its_driver(machine):
    machine.disguised = ("egl:0",)
    assert chosen() == "egl:1"
    assert machine.closed == 1
    machine.disguised = ("egl:0", "egl:1")
    machine.broken = ("egl:2",)
    assert chosen() == "egl:0"


def test_auto_names_every_device_that_failed_in_one_line(machine):
    machine.broken = ("egl:0", "egl:1", "egl:2")
    with pytest.raises(DeviceError) as raised:
        chosen()
    assert all(spec in str(raised.value) for spec in machine.broken)
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize(
    ("wanted", "spec"),
    [
        ("software", "egl:2"),
        ("egl:1", "egl:1"),
        ("cuda:0", "egl:1"),
        ("cuda:1", "egl:0"),
        ("nvidia", "egl:0"),
        ("quadro b", "egl:1"),
        ("llvm", "egl:2"),
    ],
)
def test_a_device_is_chosen_by_number_kind_or_part_of_its_name(machine, wanted, spec):
    assert chosen(wanted) == spec


@pytest.mark.parametrize(
    ("wanted", "message"),
    [
        ("egl:7", "egl:0, egl:1, egl:2"),
        ("egl:one", "egl:0, egl:1, egl:2"),
        ("cuda:5", "cuda:"),
        ("sofware", "did you mean 'software'?"),
        ("radeon", "Quadro B"),
    ],
)
def test_an_unknown_device_is_one_line_with_those_there_are(machine, wanted, message):
    with pytest.raises(DeviceError, match=f"^device '{wanted}'") as raised:
        chosen(wanted)
    assert message in str(raised.value)
    assert "\n" not in str(raised.value)


def test_a_machine_without_software_device_says_so(machine):
    machine.devices = [GPU]
    with pytest.raises(DeviceError, match="libgl1-mesa-dri"):
        chosen("software")


def test_no_device_at_all_is_one_line_with_the_mend(machine):
    machine.devices = []
    with pytest.raises(DeviceError, match="NVIDIA_DRIVER_CAPABILITIES=all"):
        chosen()


def test_the_environment_steers_auto_only(machine, monkeypatch):
    monkeypatch.setenv("GLCONTEXT_DEVICE_INDEX", "1")
    assert chosen() == "egl:1"
    assert chosen("egl:0") == "egl:0"


def test_the_chosen_device_is_logged(machine, caplog):
    with caplog.at_level(logging.INFO, "deferred_ir"):
        chosen()
    assert "Quadro A (egl:0, hardware)" in caplog.text


def test_a_real_context_is_core_4_3_and_its_loader_finds_functions():
    context, loader, device = devices.create_context()
    assert context.version_code >= devices.FLOOR
    assert loader.load("glQueryCounter")
    assert device.name == context.info["GL_RENDERER"]
    assert context.error == "GL_NO_ERROR"
    devices.close(context, loader)


def test_contexts_can_be_opened_and_closed_many_times_beside_another():
    context, loader, device = devices.create_context()
    for _ in range(20):
        devices.close(*devices.open_device(device)[:2])
    with context:
        assert context.buffer(b"kept").read() == b"kept"
    devices.close(context, loader)


def failure(**environment):
    """The last line and the number of lines that opening a device writes, in a process with these variables."""
    script = "from deferred_ir.gl.devices import create_context; from deferred_ir.base.errors import Error\n"
    script += "try:\n    create_context('software')\nexcept Error as error:\n    print(error)\n"
    return subprocess.run(
        [sys.executable, "-c", script],
        env={**os.environ, **environment},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=True,
    ).stdout


@pytest.mark.parametrize(
    ("variables", "message"),
    [
        ({"GLCONTEXT_LINUX_LIBEGL": "libMissing.so"}, "libMissing.so cannot be loaded"),
        ({"__EGL_VENDOR_LIBRARY_FILENAMES": "/missing.json"}, "EGL finds no driver"),
        ({"MESA_GL_VERSION_OVERRIDE": "4.2"}, "offers OpenGL 4.2"),
        ({"LIBGL_DRIVERS_PATH": "/missing", "GBM_BACKENDS_PATH": "/missing"}, "apt install libgl1-mesa-dri"),
    ],
)
def test_a_machine_without_enough_opengl_gets_one_line(variables, message):
    text = failure(**variables)
    assert message in text
    assert len(text.splitlines()) == 1
