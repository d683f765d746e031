"""OpenGL's errors are raised where they happen, with the line that made the call."""

from __future__ import annotations

import numpy as np
import pytest
from small_scenes import room

from deferred_ir.base.errors import DeviceError
from deferred_ir.gl.context import Gpu
from deferred_ir.gl.debug import SWITCH
from deferred_ir.gl.textures import GpuTexture
from deferred_ir.graph.ports import Texture

NOWHERE = 0x1234


def test_an_error_names_the_call_and_the_line(gpu):
    gpu.gl.BindTexture(NOWHERE, 1)
    with pytest.raises(DeviceError, match=r"^here: GL_INVALID_ENUM in glBindTexture.*, called at test_debug_output"):
        gpu.check("here")
    gpu.check("here")
    assert gpu.gl.GetError()


def test_a_pass_that_makes_an_error_is_named(renderer, monkeypatch):
    one = renderer((8, 8))
    plan = one.plan(room(), 4)
    lighting = next(step.work for step in plan.steps if step.name == "lighting")
    monkeypatch.setattr(lighting, "execute", lambda frame, io: io.gpu.gl.BindTexture(NOWHERE, 1))
    with pytest.raises(DeviceError, match=r"^lighting: GL_INVALID_ENUM"):
        one.draw(room(), plan)
    with one.gpu.ctx:
        assert one.gpu.gl.GetError()


def test_moderngls_calls_are_heard_too(gpu):
    gpu.ctx.enable_direct(NOWHERE)
    with pytest.raises(DeviceError, match=r"GL_INVALID_ENUM in glEnable.*, called at test_debug_output"):
        gpu.check("here")
    assert gpu.ctx.error == "GL_INVALID_ENUM"


def test_an_error_that_is_raised_anyway_is_not_raised_twice(gpu):
    with pytest.raises(DeviceError, match=r"^texture .*; use a smaller size"):
        GpuTexture(gpu, Texture("rgba32f", layers=10**6), (8, 8))
    gpu.check("here")


def test_what_nobody_looked_at_shows_at_the_end():
    gpu = Gpu("software")
    gpu.gl.BindTexture(NOWHERE, 1)
    with pytest.raises(DeviceError, match=r"^closing: GL_INVALID_ENUM"):
        gpu.close()


def test_it_is_off_unless_asked_for(monkeypatch):
    monkeypatch.delenv(SWITCH)
    gpu = Gpu("software")
    gpu.gl.BindTexture(NOWHERE, 1)
    gpu.check("here")
    assert np.any(gpu.gl.GetError())
    gpu.close()
