"""The measurement of the viewer runs and reports its results."""

from importlib import import_module

import pytest

measured = import_module("deferred_ir.profiling.limits.viewer")


def test_a_moving_light_is_timed_pass_by_pass(viewer):
    viewer.session.choose("incremental")
    viewer.session.adjust("vpl.count", 8)
    parts = measured.measure(viewer, 4)
    assert all(len(times) == 4 for times in parts.values())
    assert parts["gbuffer"] == [0.0] * 4, "it is skipped while only the light moves"
    assert min(parts["lighting"]) > 0
    sums = [sum(times[i] for name, times in parts.items() if name != measured.FRAME) for i in range(4)]
    assert sums == pytest.approx(parts[measured.FRAME])
    text = measured.table("cornell", parts)
    assert "frames a second" in text
    assert text.count("\n| ") == len(parts) + 2
