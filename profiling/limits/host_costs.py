"""Costs beside the GPU: Python's own time in a frame, and a cold start against the least possible one."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from typing import Any
from unittest import mock

import moderngl

from deferred_ir.engine.renderer import Renderer
from deferred_ir.gl import raw
from deferred_ir.loading.load import load
from deferred_ir.rays.tracer import Tracer

CALLS = {
    moderngl.VertexArray: ("render", "render_indirect"),
    moderngl.Buffer: ("write",),
    moderngl.Context: ("finish", "enable", "disable", "enable_direct", "disable_direct", "__enter__", "__exit__"),
    Tracer: ("_map",),
}
"""Methods whose time is not Python's: of drivers, which draw in the caller's thread without a GPU, and of Embree."""
CONTEXT = "import numpy, moderngl; moderngl.create_standalone_context({}).clear()"
"""The least that a program with arrays and OpenGL has to do."""


@contextmanager
def stopwatch() -> Iterator[list[float]]:
    """Yield a list of one number: the thread's seconds inside calls of OpenGL and Embree that can take long."""
    spent = [0.0]

    def timed(function: Callable[..., Any]) -> Callable[..., Any]:
        def call(*arguments: Any, **options: Any) -> Any:
            start = time.thread_time()
            result = function(*arguments, **options)
            spent[0] += time.thread_time() - start
            return result

        return call

    find = raw.GL.__getattr__
    with ExitStack() as patches:
        for kind, names in CALLS.items():
            for name in names:
                patches.enter_context(mock.patch.object(kind, name, timed(getattr(kind, name))))
        patches.enter_context(mock.patch.object(raw.GL, "__getattr__", lambda gl, name: timed(find(gl, name))))
        yield spent


def python_time(scene: str, *, vpls: int, size: tuple[int, int], turns: int, device: str) -> list[float]:
    """Return Python's own time in each of `turns` deferred frames, milliseconds.

    It is the thread's CPU time without that inside OpenGL and Embree. Only OpenGL calls that can take long are
    subtracted, so it is an upper bound. Waiting does not count, since a busy machine adds it anywhere.
    """
    loaded, times = load(scene), []
    with stopwatch() as spent, Renderer(size, "deferred", device) as renderer:
        plan = renderer.plan(loaded, vpls, ["radiance"])
        renderer.draw(loaded, plan)
        for _ in range(turns):  # with one seed, as in an animation, whose pattern is made once
            start, others = time.thread_time(), spent[0]
            renderer.draw(loaded, plan)
            times.append((time.thread_time() - start - (spent[0] - others)) * 1e3)
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
