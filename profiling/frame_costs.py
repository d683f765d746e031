"""Deferred against forward, side by side in one run, and Python's own share of a deferred frame.

    python -m deferred_ir.profiling.frame_costs cornell atrium --vpls 64 --size 512x512 --frames 9

Graphs take turns frame by frame, so that a noisy machine disturbs both alike. `shading` is the frame without its
shadow maps, which both graphs draw. `Python` is wall time less the time inside OpenGL and Embree calls; of OpenGL only
the calls that can take long are taken off, so it is an upper bound.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from statistics import median, quantiles
from typing import Any
from unittest import mock

import moderngl

from deferred_ir.gl import raw
from deferred_ir.loading import load
from deferred_ir.renderer import Renderer
from deferred_ir.scene import Scene
from deferred_ir.scene_file import parse_size
from deferred_ir.timing import Record

GRAPHS = ("deferred", "forward")
CALLS = {
    moderngl.VertexArray: ("render",),
    moderngl.Buffer: ("write",),
    moderngl.Context: ("finish", "enable", "disable", "enable_direct", "disable_direct", "__enter__", "__exit__"),
}
"""Methods of moderngl that can wait for the driver."""


def side_by_side(scene: Scene, vpls: int, size: tuple[int, int], frames: int) -> dict[str, Record]:
    """Frame times of both graphs, drawn in turns."""
    renderers = {graph: Renderer(size, graph) for graph in GRAPHS}
    records = {graph: Record() for graph in GRAPHS}
    plans = {graph: renderer.plan(scene, vpls, ["radiance"]) for graph, renderer in renderers.items()}
    for graph, renderer in renderers.items():
        renderer.draw(scene, plans[graph])
    for seed in range(frames):
        for graph, renderer in renderers.items():
            renderer.draw(scene, plans[graph], seed=seed, record=records[graph])
    for graph, renderer in renderers.items():
        renderer.finish(records[graph])
        renderer.close()
    return records


def shading(record: Record) -> list[float]:
    """Frame times without the shadow maps, milliseconds."""
    return [frame - laps["shadow_maps"][0] for frame, laps in zip(record.frame_ms, record.laps, strict=True)]


@contextmanager
def stopwatch() -> Iterator[list[float]]:
    """Add the time inside long OpenGL calls to the one number of the list."""
    spent = [0.0]

    def timed(function: Callable[..., Any]) -> Callable[..., Any]:
        def call(*arguments: Any, **options: Any) -> Any:
            start = time.perf_counter()
            result = function(*arguments, **options)
            spent[0] += time.perf_counter() - start
            return result

        return call

    find = raw.GL.__getattr__
    with ExitStack() as patches:
        for kind, names in CALLS.items():
            for name in names:
                patches.enter_context(mock.patch.object(kind, name, timed(getattr(kind, name))))
        patches.enter_context(mock.patch.object(raw.GL, "__getattr__", lambda gl, name: timed(find(gl, name))))
        yield spent


def python_time(scene: Scene, vpls: int, size: tuple[int, int], frames: int) -> list[float]:
    """Python's own time in each of `frames` deferred frames, milliseconds."""
    times = []
    with stopwatch() as spent, Renderer(size, "deferred") as renderer:
        plan = renderer.plan(scene, vpls, ["radiance"])
        renderer.draw(scene, plan)
        for _ in range(frames):
            before = spent[0] + renderer.embree_seconds
            start = time.perf_counter()
            renderer.draw(scene, plan)
            wall = time.perf_counter() - start
            times.append((wall - (spent[0] + renderer.embree_seconds - before)) * 1e3)
    return times


def spread(values: list[float]) -> str:
    """Median and quartiles."""
    low, _, high = quantiles(values, n=4)
    return f"{median(values):8.1f} ({low:.1f} to {high:.1f})"


def main() -> None:
    """Print a table for each scene."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("scenes", nargs="+", metavar="SCENE")
    parser.add_argument("--vpls", type=int, default=64)
    parser.add_argument("--size", type=parse_size, default=(512, 512))
    parser.add_argument("--frames", type=int, default=9, choices=range(2, 1000), metavar="N")
    arguments = parser.parse_args()
    for name in arguments.scenes:
        scene = load(name)
        records = side_by_side(scene, arguments.vpls, arguments.size, arguments.frames)
        print(f"{scene.name}: {len(scene.geometry.faces)} triangles, {arguments.vpls} VPLs, median (quartiles) ms")
        for graph, record in records.items():
            print(f"  {graph:9} frame {spread(record.frame_ms)}   shading {spread(shading(record))}")
        fast, slow = records["deferred"], records["forward"]
        whole = [b / a for a, b in zip(fast.frame_ms, slow.frame_ms, strict=True)]
        rest = [b / a for a, b in zip(shading(fast), shading(slow), strict=True)]
        print(f"  ratio     frame {spread(whole)}   shading {spread(rest)}")
        own = python_time(scene, arguments.vpls, arguments.size, arguments.frames)
        print(f"  Python's own time in a deferred frame: {median(own):.2f} ms")


if __name__ == "__main__":
    main()
