"""Fixtures that several files of tests share: OpenGL in software, with a look at OpenGL's error around every test."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Callable, Iterator
from typing import Any
from unittest import mock

import hypothesis
import pytest

from deferred_ir.engine.renderer import Renderer
from deferred_ir.gl.context import Gpu
from deferred_ir.gl.debug import SWITCH

if "PYTEST_XDIST_WORKER" in os.environ:
    os.environ.setdefault("LP_NUM_THREADS", "1")  # llvmpipe: every core has a process of tests already
os.environ[SWITCH] = "1"  # OpenGL's complaints are errors, in every process that tests start

# The same examples in every run, and no clocks: a busy machine must not fail a test.
hypothesis.settings.register_profile("project", deadline=None, derandomize=True)
hypothesis.settings.load_profile("project")


OPENGL_FIXTURES = {"software_gpu", "gpu", "renderer", "screen", "viewer_window", "viewer"}


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--quick", action="store_true", help="only tests without OpenGL, other processes and mark 'slow'")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """With --quick, leave out slow tests and those with fixtures that need OpenGL."""
    if not config.getoption("--quick"):
        return
    chosen, others = [], []
    for item in items:
        slow = item.get_closest_marker("slow") or OPENGL_FIXTURES & set(getattr(item, "fixturenames", ()))
        (others if slow else chosen).append(item)
    config.hook.pytest_deselected(items=others)
    items[:] = chosen


@pytest.fixture(scope="session", autouse=True)
def quick(request: pytest.FixtureRequest) -> Iterator[None]:
    """With --quick, skip a test as soon as it opens an OpenGL context or starts a process."""
    if not request.config.getoption("--quick"):
        yield
        return

    def skip(*_: Any, **__: Any) -> None:
        pytest.skip("--quick: needs OpenGL or another process")

    with mock.patch.object(Gpu, "__init__", skip), mock.patch.object(subprocess.Popen, "__init__", skip):
        yield


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
        software_gpu.check("before")
        yield software_gpu
        software_gpu.check("after")
        assert software_gpu.ctx.error == "GL_NO_ERROR"


@pytest.fixture
def renderer() -> Iterator[Callable[..., Renderer]]:
    """Makes Renderers on the software device; all are without OpenGL errors before and after the test."""
    made: list[Renderer] = []

    def clean(one: Renderer) -> None:
        one.gpu.check("test")
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


@pytest.fixture(scope="session")
def screen() -> Iterator[str]:
    """A virtual display of this process's own."""
    import glfw
    from virtual_display import display

    with display() as name:
        # Whoever ends GLFW, be it the doctor, closes the windows of all others.
        with mock.patch.object(glfw, "terminate"):
            yield name
        glfw.terminate()


@pytest.fixture(scope="session")
def viewer_window(screen: str) -> Iterator[Any]:
    """One window for all tests; at the end it is closed while a reference is traced."""
    import glfw
    from virtual_display import FEW, SIZE, close_renderer, cornell, xdo

    from deferred_ir.gl.window import Window
    from deferred_ir.viewer.app import Viewer
    from deferred_ir.viewer.panels.side_panel import WIDTH
    from deferred_ir.viewer.session import Session

    del screen
    window = Window("deferred-ir test", (SIZE[0] + WIDTH, SIZE[1]))
    viewer = Viewer(window, Session(cornell(), SIZE, window, settings=FEW))
    viewer.frame()
    xdo("search", "--sync", "--name", "deferred-ir test", "windowfocus", "--sync")
    glfw.make_context_current(None)  # else contexts of other tests would never become current
    yield viewer
    with window:
        viewer.panel.reference.start()
        viewer.frame()
        viewer.close()
    assert not viewer.panel.reference.job.running
    close_renderer()


@pytest.fixture
def viewer(viewer_window: Any) -> Iterator[Any]:
    """The window with the Cornell box as it was at first."""
    from virtual_display import restore

    shared, session = viewer_window, viewer_window.session
    with shared.window:
        restore(shared)
        yield shared
    with session.renderer.gpu.ctx:
        assert session.renderer.gpu.ctx.error == "GL_NO_ERROR"
