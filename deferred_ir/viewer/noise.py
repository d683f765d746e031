"""Estimates the error that is left in a mean of frames, from how far its two halves differ."""

from __future__ import annotations

from typing import Any

from deferred_ir.engine.accumulation import Accumulation


class Noise:
    """Remembers the sum of frames at the last power of two, and at each new one compares the two halves."""

    def __init__(self) -> None:
        self._mean: Accumulation | None = None
        self._last: tuple[int, Any] = 0, None
        self._estimate: tuple[int, float] | None = None

    def add(self, mean: Accumulation) -> None:
        """Take in `mean`, after each of its frames; another mean starts afresh."""
        if mean is not self._mean:
            self._mean, self._last, self._estimate = mean, (0, None), None
        count = mean.frames
        if count & (count - 1):
            return
        half, total = self._last
        if 2 * half == count:
            self._estimate = count, estimate_noise(total / half, (mean.total - total) / half)
        self._last = count, mean.total

    def estimate(self, mean: Accumulation) -> float | None:
        """Return the relMSE (untrimmed) to be expected of the mean for its own noise; None before its second frame."""
        if mean is not self._mean or self._estimate is None:
            return None
        count, noise = self._estimate
        return noise * count / mean.frames


def estimate_noise(first: Any, second: Any) -> float:
    """Estimate the relMSE of the mean of two independent images (H, W, 4): a quarter of their squared difference."""
    first, second = first[..., :3], second[..., :3]
    mean = (first + second) / 2
    lit = (mean > 0).any(axis=-1)
    if not lit.any():
        return 0.0
    error = (first - second)[lit] ** 2 / (mean[lit] ** 2 + 0.01 * mean[lit].mean() ** 2)
    return float(error.mean() / 4)
