"""The doctor sees what is there, names the mend for what is not, and never raises."""

from importlib import metadata

import pytest

from deferred_ir.base.errors import DeviceError
from deferred_ir.cli import machine
from deferred_ir.cli.commands.devices import format_devices
from deferred_ir.cli.machine import Check
from deferred_ir.gl import devices, egl


def find(results, name):
    return next(check for check in results if check.name.startswith(name))


@pytest.fixture(scope="module")
def results():
    return machine.run_checks()


def test_a_machine_that_runs_these_tests_is_healthy(results):
    assert machine.is_healthy(results), machine.format_report(results)
    assert find(results, "OpenGL 4.3").ok
    assert "traces rays" in find(results, "embreex").found


def test_every_requirement_of_the_package_is_looked_at(results):
    names = [check.name for check in results]
    for line in metadata.requires("deferred-ir"):
        name = line.partition(">=")[0]
        assert ("extra == 'dev'" in line or 'extra == "dev"' in line) or name in names


def test_the_report_is_a_table_with_a_verdict(results):
    lines = machine.format_report(results).splitlines()
    assert lines[-1] == "All that is required is there."
    assert any(line.startswith("ok") and "moderngl" in line for line in lines)


def test_a_fault_is_marked_followed_by_its_mend_and_counts():
    results = [
        Check("EGL library", False, "none", "apt install libegl1"),
        Check("display", False, "none", optional=True),
    ]
    lines = machine.format_report(results).splitlines()
    assert lines[0].startswith("FAULT")
    assert "apt install libegl1" in lines[1]
    assert lines[-1] == "1 to mend: EGL library"
    assert not machine.is_healthy(results)
    assert machine.is_healthy(results[1:])


def test_without_a_device_the_doctor_still_reports(monkeypatch):
    def fail(*_):
        raise DeviceError(egl.NO_DRIVER)

    monkeypatch.setattr(egl, "list_devices", fail)
    monkeypatch.setattr(devices, "create_context", fail)
    results = machine.run_checks()
    assert not find(results, "devices").ok
    assert "NVIDIA_DRIVER_CAPABILITIES" in find(results, "context").mend
    with pytest.raises(DeviceError):
        format_devices()


def test_a_missing_an_old_and_a_broken_package_are_faults(monkeypatch):
    lines = ["no-such-package>=1.0", "numpy>=999", "pytest>=1"]
    monkeypatch.setattr(machine.metadata, "requires", lambda _: lines)
    monkeypatch.setattr(machine.importlib, "import_module", lambda name: 1 / 0)
    results = machine.run_checks()
    assert find(results, "no-such-package").found == "not installed"
    assert "999 or newer is needed" in find(results, "numpy").found
    assert "import fails" in find(results, "pytest").found
    assert not machine.is_healthy(results)


def test_variables_that_overrule_are_told(monkeypatch):
    monkeypatch.setenv("CUDA_VISIBLE_DEVICES", "0")
    assert "cuda:N" in find(machine.run_checks(), "CUDA_VISIBLE_DEVICES").mend


def test_an_unknown_device_is_a_fault_with_a_mend():
    context = find(machine.run_checks(device="egl:99"), "context")
    assert not context.ok
    assert context.mend


def test_the_devices_table_marks_one_choice_and_says_why_a_device_fails(monkeypatch):
    broken = egl.Device(98, "hardware", "card", "/dev/dri/card9", 3, "egl:98")
    listed = egl.list_devices()
    monkeypatch.setattr(egl, "list_devices", lambda: [broken, *listed])
    lines = format_devices().splitlines()
    assert len(lines) == 2 + len(listed)
    assert "requested device index 98" in lines[1]
    assert [line.startswith("*") for line in lines].count(True) == 1
