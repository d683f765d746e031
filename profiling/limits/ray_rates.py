"""Rays a second of the passes that trace, as a share of what Embree alone does with the same rays."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from itertools import pairwise
from typing import Any
from unittest import mock

import numpy as np

from deferred_ir.engine.executor import Executor
from deferred_ir.engine.renderer import Renderer
from deferred_ir.loading.load import load
from deferred_ir.profiling.measure import take_turns
from deferred_ir.rays.embree import EmbreeScenes

PASSES = "direct_rays", "trace_choices", "near_field"
"""The passes of the graph `resampled` that trace rays beside those that make VPLs."""
QUERIES = "closest", "occluded"


@dataclass(frozen=True, eq=False)
class Rays:
    """Rays of one pass and one query: which method of `scenes`, and its arguments for each call."""

    scenes: EmbreeScenes
    query: str
    arguments: tuple[np.ndarray, ...]

    def trace(self, threads: ThreadPoolExecutor, count: int) -> None:
        """Trace them in as many batches as threads."""
        ends = np.linspace(0, len(self.arguments[0]), count + 1).astype(int)
        batches = [[array[a:b] for array in self.arguments] for a, b in pairwise(ends)]
        list(threads.map(lambda batch: getattr(self.scenes, self.query)(*batch), batches))


@contextmanager
def recorder() -> Iterator[dict[tuple[str, str], list[Any]]]:
    """Yield what queries of Embree are asked with, by pass and query: a list of (scenes, arguments) each."""
    calls: dict[tuple[str, str], list[Any]] = {}
    running = [""]
    execute = Executor._execute

    def step(executor: Executor, chosen: Any, *arguments: Any) -> None:
        running[0] = chosen.name
        execute(executor, chosen, *arguments)

    def recorded(query: str, ask: Callable[..., Any]) -> Callable[..., Any]:
        def call(scenes: EmbreeScenes, *arguments: Any) -> Any:
            calls.setdefault((running[0], query), []).append((scenes, arguments))
            return ask(scenes, *arguments)

        return call

    with ExitStack() as patches:
        patches.enter_context(mock.patch.object(Executor, "_execute", step))
        for query in QUERIES:
            asked = recorded(query, getattr(EmbreeScenes, query))
            patches.enter_context(mock.patch.object(EmbreeScenes, query, asked))
        yield calls


@contextmanager
def stopwatch() -> Iterator[dict[str, float]]:
    """Yield the seconds of each pass, from the end of OpenGL's work for the pass before to that of its own."""
    spent: dict[str, float] = {}
    execute = Executor._execute

    def step(executor: Executor, chosen: Any, *arguments: Any) -> None:
        executor.gpu.ctx.finish()
        start = time.perf_counter()
        execute(executor, chosen, *arguments)
        executor.gpu.ctx.finish()
        spent[chosen.name] = time.perf_counter() - start

    with mock.patch.object(Executor, "_execute", step):
        yield spent


def join(calls: Mapping[tuple[str, str], Sequence[Any]]) -> dict[str, list[Rays]]:
    """Return the rays of each of PASSES that traced some."""
    found: dict[str, list[Rays]] = {}
    for (name, query), made in calls.items():
        if name in PASSES:
            arrays = tuple(np.concatenate(column) for column in zip(*(arguments for _, arguments in made), strict=True))
            found.setdefault(name, []).append(Rays(made[0][0], query, arrays))
    return found


def measure_ray_rates(
    scene: str, *, vpls: int, size: tuple[int, int], turns: int, device: str
) -> dict[str, tuple[list[float], float]]:
    """Return the ratio of each turn and the millions of rays in a frame, by pass; "all three" are PASSES together.

    The ratio is Embree's time over the pass's: in each turn a frame of the graph `resampled` is drawn, and then Embree
    gets the same rays in one batch a core, with nothing else timed.
    """
    loaded, cores = load(scene), os.cpu_count() or 1
    alone: dict[str, list[float]] = {}
    spent: dict[str, list[float]] = {}
    with Renderer(size, "resampled", device) as renderer, ThreadPoolExecutor(cores) as threads:
        plan = renderer.plan(loaded, vpls, ["radiance"])
        with recorder() as calls:
            renderer.draw(loaded, plan)
        rays = join(calls)
        for _, side in take_turns(("frame", "Embree"), turns, scene):
            if side == "frame":
                with stopwatch() as times:
                    renderer.draw(loaded, plan)
                for name in rays:
                    spent.setdefault(name, []).append(times[name])
                continue
            for name, parts in rays.items():
                start = time.perf_counter()
                for part in parts:
                    part.trace(threads, cores)
                alone.setdefault(name, []).append(time.perf_counter() - start)
    counts = {name: sum(len(part.arguments[0]) for part in parts) / 1e6 for name, parts in rays.items()}
    for seconds in (alone, spent):
        seconds["all three"] = [sum(turn) for turn in zip(*seconds.values(), strict=True)]
    counts["all three"] = sum(counts.values())
    return {name: ([a / b for a, b in zip(alone[name], spent[name], strict=True)], counts[name]) for name in counts}
