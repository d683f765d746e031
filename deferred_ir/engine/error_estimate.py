"""Estimate the error of a mean of frames from the frames alone, without a reference.

Frames are independent, so how far they differ tells the noise of their mean: a quarter of the squared difference of
two halves, on average. Here they are dealt to four groups, and all ways of halving those are averaged, which is the
variance of the groups over their number. What all frames get wrong alike cannot be seen so. But where a graph gives its
light unfiltered as well, the filter's error is known, too: what the filter changes in one group, times what it changes
in another, is on average the square of its error. The mean is then the blend of filtered and unfiltered light with the
least error (two buffers as in Rousselle et al. 2012): filtered at first, unfiltered in the end.

relMSE divides by the squared truth, in whose place stands the mean without the group whose difference is divided: else
pixels that are too bright by noise would hide their own error.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from deferred_ir.base.arrays import Array
from deferred_ir.base.relative_error import trimmed_mean, weigh

GROUPS = 4
"""Groups that frames are dealt to, in turns."""


@dataclass(frozen=True)
class Estimate:
    """What is to be expected of the mean of `frames` frames, as trimmed relMSE.

    noise: what the frames do not share. filter: what the filter adds. unfiltered_noise: noise of the mean without it.
    share: how much of the mean is filtered light; 1 where a graph gives no unfiltered light.
    """

    frames: int
    noise: float
    filter: float = 0.0
    unfiltered_noise: float = 0.0
    share: float = 1.0

    @property
    def error(self) -> float:
        """All that the frames tell of the error."""
        return self.noise + self.filter

    def count_frames(self, target: float) -> float:
        """Predict after how many frames the error is at most `target`: noise falls as their number rises."""
        filtered = self.frames * self.noise / (target - self.filter) if self.filter < target else np.inf
        return min(filtered, self.frames * (self.unfiltered_noise or self.noise) / target)


@dataclass(frozen=True, eq=False)
class Sums:
    """Sums of one output: over all frames, float64 (H, W, 4), and over those of each group, float32 (H, W, 3)."""

    frames: int = 0
    total: Any = 0.0
    groups: tuple[Any, ...] = GROUPS * (0.0,)

    def add(self, pixels: Any) -> Sums:
        """Return the sums with one more frame, float32 (H, W, 4)."""
        groups = list(self.groups)
        groups[self.frames % GROUPS] = groups[self.frames % GROUPS] + pixels[..., :3]
        return Sums(self.frames + 1, self.total + pixels.astype(np.float64), tuple(groups))


@dataclass(frozen=True, eq=False)
class Spread:
    """What is kept of frames for an estimate. unfiltered: None where there is no such light."""

    filtered: Sums = Sums()
    unfiltered: Sums | None = None

    @property
    def frames(self) -> int:
        """How many frames there are."""
        return self.filtered.frames

    def add(self, filtered: Any, unfiltered: Any = None) -> Spread:
        """Return the sums with one more frame: linear radiance with and without the filter, float32 (H, W, 4)."""
        other = None if unfiltered is None else (self.unfiltered or Sums()).add(unfiltered)
        return Spread(self.filtered.add(filtered), other)

    def mean(self, share: float = 1.0) -> Array:
        """Return the mean of the frames, float64 (H, W, 4), with this share of filtered light."""
        mean: Array = self.filtered.total / self.frames
        if self.unfiltered is not None and share < 1:
            mean = share * mean + (1 - share) * self.unfiltered.total / self.frames
        return mean

    def estimate(self) -> Estimate | None:
        """Estimate the error of the mean; None before the second frame."""
        if self.frames < 2:
            return None
        image = self.filtered.total[..., :3] / self.frames
        count = int((image != 0).any(axis=-1).sum())
        if not count:
            return Estimate(self.frames, 0.0)
        brightness = float(image.sum() / (3 * count))
        filtered = _Groups(self.filtered)
        if self.unfiltered is None:
            return Estimate(self.frames, trimmed_mean(filtered.relative_noise(brightness), count))
        unfiltered = _Groups(self.unfiltered)
        changes = filtered.blend(unfiltered, 1.0, -1.0)
        # Least squares: unfiltered light plus the share of the changes that brings it nearest to the truth.
        weights = weigh(image, brightness)
        noises = [(groups.noise() / weights).sum() for groups in (filtered, changes, unfiltered)]
        moment = (changes.mean**2 / weights).sum()
        share = float(np.clip((noises[1] + noises[2] - noises[0]) / (2 * moment), 0, 1)) if moment > 0 else 1.0
        blend = filtered.blend(unfiltered, share, 1 - share)
        inverse = np.mean([1 / weigh(blend.mean_without(number), brightness) for number in blend.numbers], axis=0)
        bias = max(float((changes.shared_squares() * inverse).sum() / (3 * count)), 0.0)
        return Estimate(
            self.frames,
            trimmed_mean(blend.relative_noise(brightness), count),
            share**2 * bias,
            trimmed_mean(unfiltered.relative_noise(brightness), count),
            share,
        )


class _Groups:
    """The sums of the groups that have frames. sizes: their numbers of frames."""

    def __init__(self, sums: Sums) -> None:
        self.numbers = range(min(sums.frames, GROUPS))
        self.sizes = [len(range(number, sums.frames, GROUPS)) for number in self.numbers]
        self._use(sums.groups[: len(self.sizes)])

    def _use(self, sums: Any) -> None:
        self.sums, self.frames = sums, sum(self.sizes)
        self.total = sum(sums)
        self.mean = self.total / self.frames

    def blend(self, other: _Groups, mine: float, others: float) -> _Groups:
        """Return the groups of `mine` times these frames plus `others` times the same frames of another output."""
        result = object.__new__(_Groups)
        result.numbers, result.sizes = self.numbers, self.sizes
        result._use([mine * one + others * two for one, two in zip(self.sums, other.sums, strict=True)])
        return result

    def mean_without(self, number: int) -> Array:
        """Return the mean of all frames but those of one group, (H, W, 3)."""
        mean: Array = (self.total - self.sums[number]) / (self.frames - self.sizes[number])
        return mean

    def noise(self) -> Array:
        """Return the variance of the mean, (H, W, 3)."""
        return self._add_up(lambda _: 1.0)

    def relative_noise(self, brightness: float) -> Array:
        """Return the variance of the mean as relMSE has it, averaged over RGB, (H, W)."""
        relative: Array = self._add_up(lambda number: 1 / weigh(self.mean_without(number), brightness)).mean(axis=-1)
        return relative

    def _add_up(self, weight: Any) -> Array:
        parts = (
            size * (self.sums[number] / size - self.mean) ** 2 * weight(number)
            for number, size in zip(self.numbers, self.sizes, strict=True)
        )
        variance: Array = sum(parts) / ((len(self.sizes) - 1) * self.frames)
        return variance

    def shared_squares(self) -> Array:
        """Return the mean product of frames of two groups, (H, W, 3): on average the square of what all share."""
        squares = sum(one**2 for one in self.sums)
        products: Array = (self.total**2 - squares) / (self.frames**2 - sum(size**2 for size in self.sizes))
        return products
