"""How far the mean of frames still is from where it is going, judged by its two halves."""

from __future__ import annotations

from typing import Any

from deferred_ir.engine.accumulation import Accumulation


class Noise:
    """Keeps the sum of frames at the last power of two, and at each new one compares the halves."""

    def __init__(self) -> None:
        self._of: Accumulation | None = None
        self._before: tuple[int, Any] = 0, None
        self._found: tuple[int, float] | None = None

    def add(self, mean: Accumulation) -> None:
        """Look at `mean` after each of its frames."""
        if mean is not self._of:
            self._of, self._before, self._found = mean, (0, None), None
        count = mean.frames
        if count & (count - 1):
            return
        before, first = self._before
        if 2 * before == count:
            self._found = count, relative(first / before, (mean.total - first) / before)
        self._before = count, mean.total

    def of(self, mean: Accumulation) -> float | None:
        """relMSE (untrimmed) to be expected of the mean for its own noise; None before its second frame."""
        if mean is not self._of or self._found is None:
            return None
        count, noise = self._found
        return noise * count / mean.frames


def relative(first: Any, second: Any) -> float:
    """relMSE of the mean of two independent images (H, W, 4): a quarter of their distance is its variance."""
    first, second = first[..., :3], second[..., :3]
    mean = (first + second) / 2
    lit = (mean > 0).any(axis=-1)
    if not lit.any():
        return 0.0
    apart = (first - second)[lit] ** 2 / (mean[lit] ** 2 + 0.01 * mean[lit].mean() ** 2)
    return float(apart.mean() / 4)
