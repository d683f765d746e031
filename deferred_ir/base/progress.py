"""Progress bars on standard error, shown on a terminal only."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, TextIO, TypeVar

Item = TypeVar("Item")

Progress = Callable[[int, int], None]
"""Called with the work done so far and all the work, both in the same unit."""


class ProgressBar:
    """A progress bar, as `progress_bar` opens it. Its methods draw nothing where standard error is no terminal."""

    def __init__(self, bar: Any | None) -> None:
        self._bar = bar

    def label(self, text: str) -> None:
        """Set the text in front of the bar."""
        if self._bar is not None:
            self._bar.set_description(text)

    def advance(self, amount: float = 1) -> None:
        """Add to the work done."""
        if self._bar is not None:
            self._bar.update(amount)
            self._show_end()

    def show(self, done: int, total: int) -> None:
        """Set the work done and all the work: a `Progress`. Less done than before starts the bar again."""
        if self._bar is None:
            return
        if done < self._bar.n:
            self._bar.reset()
        self._bar.total = total
        self._bar.update(done - self._bar.n)
        self._show_end()

    def _show_end(self) -> None:
        """Draw the bar when the work is done, however soon after the last time."""
        if self._bar is not None and self._bar.total and self._bar.n >= self._bar.total:
            self._bar.refresh()

    def print(self, text: str, file: TextIO | None = None) -> None:
        """Print a line above the bar, on standard output by default."""
        if self._bar is None:
            print(text, file=file, flush=True)
        else:
            self._bar.write(text, file=file)


@contextmanager
def progress_bar(
    label: str = "", total: float | None = None, *, unit: str = "", leave: bool = False, at_most: bool = False
) -> Iterator[ProgressBar]:
    """Open a bar with the time spent and the time left.

    unit: counts the work in these, such as "frame"; without it only a percentage is shown. leave: the finished bar
    stays on the terminal. at_most: the work may end long before `total`, so no time left is shown; wants a `unit`.
    """
    if not sys.stderr.isatty():
        yield ProgressBar(None)
        return
    from tqdm import tqdm

    count = f"{{n_fmt}}/{{total_fmt}} {unit}s, " if unit else ""
    style = f"{{desc}}{{percentage:3.0f}} % |{{bar}}| {count}{{elapsed}}, {{remaining}} left"
    if at_most:
        style = f"{{desc}}{{n:.0f}} of at most {{total:.0f}} {unit}s |{{bar}}| {{elapsed}}"
    desc = f"{label}: " if label else ""
    with tqdm(total=total, desc=desc, bar_format=style, leave=leave, file=sys.stderr) as bar:
        yield ProgressBar(bar)


def track(items: Sequence[Item], label: str) -> Iterator[Item]:
    """Yield each item, with a progress bar."""
    with progress_bar(label, len(items)) as bar:
        for item in items:
            yield item
            bar.advance()
