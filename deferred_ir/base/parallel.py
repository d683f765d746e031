"""Runs tasks on threads and returns results in order, so that sums do not depend on the number of threads."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Generator, Iterable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TypeVar

Task = TypeVar("Task")
Result = TypeVar("Result")

AHEAD = 4
"""Tasks in flight for each thread: enough to keep all busy, with few results in memory."""


def run_in_order(
    function: Callable[[Task], Result], tasks: Iterable[Task], threads: int | None = None
) -> Generator[Result, None, None]:
    """Yield the result of `function` for each task, in the order of the tasks.

    threads: how many work at the same time, None for as many as the machine has. Close the generator
    (contextlib.closing) where a loop over it may end early: tasks that have not begun are then cancelled.
    """
    threads = threads or os.cpu_count() or 1
    waiting: deque[Future[Result]] = deque()
    with ThreadPoolExecutor(threads) as pool:
        try:
            for task in tasks:
                waiting.append(pool.submit(function, task))
                if len(waiting) > AHEAD * threads:
                    yield waiting.popleft().result()
            while waiting:
                yield waiting.popleft().result()
        finally:
            for future in waiting:
                future.cancel()
