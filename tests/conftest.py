"""Fixtures that several files of tests share: OpenGL in software, with a look at OpenGL's error around every test."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import hypothesis
import pytest

from deferred_ir.gl.gpu import Gpu
from deferred_ir.renderer import Renderer

# The same examples in every run, and no clocks: a busy machine must not fail a test.
hypothesis.settings.register_profile("project", deadline=None, derandomize=True)
hypothesis.settings.load_profile("project")


@pytest.fixture(scope="session")
def software_gpu() -> Iterator[Gpu]:
    gpu = Gpu("software")
    yield gpu
    gpu.close()


@pytest.fixture
def gpu(software_gpu: Gpu) -> Iterator[Gpu]:
    """The software device, current; OpenGL has no error before and after the test."""
    with software_gpu.ctx:
        software_gpu.reset()
        assert software_gpu.ctx.error == "GL_NO_ERROR"
        yield software_gpu
        assert software_gpu.ctx.error == "GL_NO_ERROR"


@pytest.fixture
def renderer() -> Iterator[Callable[..., Renderer]]:
    """Makes Renderers on the software device; all are without OpenGL errors before and after the test."""
    made: list[Renderer] = []

    def clean(one: Renderer) -> None:
        with one.gpu.ctx:
            assert one.gpu.ctx.error == "GL_NO_ERROR"

    def make(*arguments: Any, **options: Any) -> Renderer:
        options.setdefault("device", "software")
        made.append(Renderer(*arguments, **options))
        clean(made[-1])
        return made[-1]

    yield make
    for one in made:
        clean(one)
        one.close()
