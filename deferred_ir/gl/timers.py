"""Measures the time of each pass on GPU and CPU, by 64-bit timestamps that are read a few frames later."""

from __future__ import annotations

import ctypes
import time
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import pairwise

from deferred_ir.gl import raw
from deferred_ir.gl.context import Gpu

DELAY = 3
"""Frames after which timestamps are read without `wait`: late enough that no driver blocks."""


@dataclass
class _Marks:
    labels: list[str] = field(default_factory=list)
    queries: list[int] = field(default_factory=list)
    cpu: list[float] = field(default_factory=list)


class Timers:
    """Laps of frames: each `mark` ends the lap before it and starts one; the end of the frame ends the last."""

    def __init__(self, gpu: Gpu) -> None:
        self.gpu = gpu
        self._free: list[int] = []
        self._frames: deque[_Marks] = deque()

    @contextmanager
    def frame(self) -> Iterator[None]:
        """Measure the laps of a frame; a frame that fails midway is discarded."""
        marks = _Marks()
        self._frames.append(marks)
        try:
            yield
            self.mark("end")
        except BaseException:
            self._frames.remove(marks)
            self._free.extend(marks.queries)
            raise

    def mark(self, label: str) -> None:
        """Start the lap `label`. Call it with the pass's framebuffer bound, which ends the work of the pass before."""
        marks = self._frames[-1]
        query = self._free.pop() if self._free else self.gpu.gl.make("GenQueries")
        self.gpu.gl.QueryCounter(query, raw.TIMESTAMP)
        if not marks.queries:
            # Drivers take a timestamp together with the work that follows it. Without the flush the first lap, which
            # may be a pass on the CPU, would begin where the second does.
            self.gpu.gl.Flush()
        marks.labels.append(label)
        marks.queries.append(query)
        marks.cpu.append(time.perf_counter())

    def collect(self, wait: bool = False) -> list[dict[str, tuple[float, float]]]:
        """Return the finished frames, oldest first: label -> (GPU ms, CPU ms). wait: also those still in flight."""
        finished = []
        while self._frames and (wait or len(self._frames) > DELAY):
            marks = self._frames.popleft()
            stamps = [self._read(query) for query in marks.queries]
            self._free.extend(marks.queries)
            laps = zip(marks.labels[:-1], pairwise(stamps), pairwise(marks.cpu), strict=True)
            finished.append({label: ((g1 - g0) / 1e6, (c1 - c0) * 1e3) for label, (g0, g1), (c0, c1) in laps})
        return finished

    def _read(self, query: int) -> int:
        value = ctypes.c_uint64()
        self.gpu.gl.GetQueryObjectui64v(query, raw.QUERY_RESULT, ctypes.byref(value))
        return value.value

    def release(self) -> None:
        """Delete all queries."""
        for query in self._free + [query for marks in self._frames for query in marks.queries]:
            self.gpu.gl.delete("DeleteQueries", query)
        self._free.clear()
        self._frames.clear()
