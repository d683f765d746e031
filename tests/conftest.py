"""Fixtures that several files of tests share: OpenGL in software, with a look at OpenGL's error around every test."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pytest

from deferred_ir.gl.gpu import Gpu
from deferred_ir.renderer import Renderer


def clean(gpu: Gpu) -> None:
    """An error left over by anyone would be raised by whoever looks next."""
    with gpu.ctx:
        assert gpu.ctx.error == "GL_NO_ERROR"


@pytest.fixture(scope="session")
def software_gpu() -> Iterator[Gpu]:
    gpu = Gpu("software")
    yield gpu
    gpu.close()


@pytest.fixture
def gpu(software_gpu: Gpu) -> Iterator[Gpu]:
    """The software device, current; OpenGL has no error before and after the test."""
    with software_gpu.ctx:
        clean(software_gpu)
        software_gpu.reset()
        yield software_gpu
        clean(software_gpu)


@pytest.fixture
def renderer() -> Iterator[Callable[..., Renderer]]:
    """Makes Renderers on the software device; all are without OpenGL errors before and after the test."""
    made: list[Renderer] = []

    def make(*arguments: Any, **options: Any) -> Renderer:
        options.setdefault("device", "software")
        made.append(Renderer(*arguments, **options))
        clean(made[-1].gpu)
        return made[-1]

    yield make
    for one in made:
        clean(one.gpu)
        one.close()
