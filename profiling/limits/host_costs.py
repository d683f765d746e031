"""Costs beside the GPU: Python's own time in a frame, and a cold start against the least possible one."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from typing import Any
from unittest import mock

import moderngl

from deferred_ir.engine.renderer import Renderer
from deferred_ir.gl import raw
from deferred_ir.loading.load import load
from deferred_ir.rays.embree import EmbreeScenes

CALLS = {
    moderngl.VertexArray: ("render", "render_indirect"),
    moderngl.Buffer: ("write",),
    moderngl.Context: ("finish", "enable", "disable", "enable_direct", "disable_direct", "__enter__", "__exit__"),
    EmbreeScenes: ("closest", "occluded"),
}
"""Methods whose time is not Python's: of drivers, which draw in the caller's thread without a GPU, and of Embree."""
CONTEXT = "import numpy, moderngl; moderngl.create_standalone_context({}).clear()"
"""The least that a program with arrays and OpenGL has to do."""


@contextmanager
def stopwatch() -> Iterator[Callable[[], float]]:
    """Yield a clock of Python's own time in seconds: CPU time of this thread and of the tasks that it hands to others.

    Calls of OpenGL and Embree that can take long do not count. OpenGL's raw functions are found from here on: make the
    context afterwards.
    """
    spent, elsewhere, find = [0.0], list[float](), raw.GL.__getattr__

    def timed(function: Callable[..., Any], times: list[float]) -> Callable[..., Any]:
        def call(*arguments: Any, **options: Any) -> Any:
            start = time.thread_time()
            try:
                return function(*arguments, **options)
            finally:
                times.append(time.thread_time() - start)  # from any thread

        return call

    def find_timed(gl: raw.GL, name: str) -> Callable[..., Any]:
        function = timed(find(gl, name), elsewhere)
        setattr(gl, name, function)
        return function

    submit = ThreadPoolExecutor.submit

    def submit_timed(pool: ThreadPoolExecutor, function: Callable[..., Any], *arguments: Any, **options: Any) -> Any:
        return submit(pool, timed(function, spent), *arguments, **options)

    with ExitStack() as patches:
        for kind, names in CALLS.items():
            for name in names:
                patches.enter_context(mock.patch.object(kind, name, timed(getattr(kind, name), elsewhere)))
        patches.enter_context(mock.patch.object(raw.GL, "__getattr__", find_timed))
        patches.enter_context(mock.patch.object(ThreadPoolExecutor, "submit", submit_timed))
        yield lambda: time.thread_time() + sum(spent) - sum(elsewhere)


def python_time(scene: str, *, graph: str, vpls: int, size: tuple[int, int], turns: int, device: str) -> list[float]:
    """Return Python's own time in each of `turns` frames of `graph`, milliseconds, all threads together.

    It is CPU time without that inside OpenGL and Embree. Only calls that can take long are subtracted, so it is an
    upper bound. Waiting does not count, since a busy machine adds it anywhere.
    """
    loaded, times = load(scene), []
    with stopwatch() as own, Renderer(size, graph, device) as renderer:
        plan = renderer.plan(loaded, vpls, ["radiance"])
        renderer.draw(loaded, plan)
        for _ in range(turns):  # with one seed, as in an animation, whose pattern is made once
            start = own()
            renderer.draw(loaded, plan)
            times.append((own() - start) * 1e3)
    return times


def cold_start(scene: str, *, vpls: int, size: tuple[int, int], turns: int, device: str) -> list[float]:
    """Return for each turn how many times as long rendering `scene` once takes as the program CONTEXT.

    Both run in new processes, in turns, after a first turn that fills the caches of files and shaders.
    """
    with tempfile.TemporaryDirectory() as folder:
        width, height = size
        options = ["--size", f"{width}x{height}", "--vpls", str(vpls), "--device", device]
        output = os.path.join(folder, "image.png")
        render = [sys.executable, "-m", "deferred_ir", "render", scene, *options, "-o", output]
        backend = "backend='egl'" if sys.platform == "linux" else ""
        bare = [sys.executable, "-c", CONTEXT.format(backend)]
        return [seconds(render) / seconds(bare) for _ in range(turns + 1)][1:]


def seconds(command: Sequence[str]) -> float:
    """Return the wall time of a process in seconds. Raises SystemExit with its output if it fails."""
    start = time.perf_counter()
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(f"{' '.join(command)}: exit status {done.returncode}\n{done.stderr}")
    return time.perf_counter() - start
