"""Estimate the error of a mean of frames from the frames alone, without a reference.

Frames are independent, so how far they differ tells the noise of their mean: a quarter of the squared difference of
two halves, on average over all ways of halving the frames. What all frames get wrong alike cannot be seen so. But where
a graph gives its light unfiltered as well, the filter's error is known, too: what the filter changes in one frame,
times what it changes in another, is on average the square of its error. The mean is then the blend of filtered and
unfiltered light with the least error (two buffers as in Rousselle et al. 2012): filtered at first, unfiltered in the
end.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from deferred_ir.base.arrays import Array
from deferred_ir.base.relative_error import trimmed_mean, weigh


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
    """Sums over frames of one output: float64 (H, W, 4), and of squares, float32 (H, W, 3), enough for a variance."""

    total: Any = 0.0
    squares: Any = 0.0

    def add(self, pixels: Any) -> Sums:
        """Return the sums with one more frame, float32 (H, W, 4)."""
        return Sums(self.total + pixels.astype(np.float64), self.squares + pixels[..., :3] ** 2)

    def noise(self, frames: int) -> Array:
        """Return the variance of the mean, (H, W, 3)."""
        mean = self.total[..., :3] / frames
        variance: Array = np.maximum(self.squares / frames - mean**2, 0) / (frames - 1)
        return variance

    def shared_squares(self, frames: int) -> Array:
        """Return the mean product of two frames, (H, W, 3): on average the square of what all frames share."""
        products: Array = (self.total[..., :3] ** 2 - self.squares) / (frames * (frames - 1))
        return products


@dataclass(frozen=True, eq=False)
class Spread:
    """What is kept of frames for an estimate. changes: what the filter changed, None without unfiltered light."""

    frames: int = 0
    filtered: Sums = Sums()
    unfiltered: Sums | None = None
    changes: Sums | None = None

    def add(self, filtered: Any, unfiltered: Any = None) -> Spread:
        """Return the sums with one more frame: linear radiance with and without the filter, float32 (H, W, 4)."""
        if unfiltered is None:
            return Spread(self.frames + 1, self.filtered.add(filtered))
        return Spread(
            self.frames + 1,
            self.filtered.add(filtered),
            (self.unfiltered or Sums()).add(unfiltered),
            (self.changes or Sums()).add(filtered - unfiltered),
        )

    def estimate(self) -> Estimate | None:
        """Estimate the error of the mean; None before the second frame."""
        n = self.frames
        if n < 2:
            return None
        image = self.filtered.total[..., :3] / n
        count = int((image != 0).any(axis=-1).sum())
        if not count:
            return Estimate(n, 0.0)
        weights = weigh(image, image.sum() / (3 * count))

        def weigh_pixels(squares: Array) -> Array:
            weighed: Array = (squares / weights).mean(axis=-1)
            return weighed

        filtered = weigh_pixels(self.filtered.noise(n))
        if self.unfiltered is None or self.changes is None:
            return Estimate(n, trimmed_mean(filtered, count))
        unfiltered, changed = (weigh_pixels(sums.noise(n)) for sums in (self.unfiltered, self.changes))
        # Least squares: unfiltered light plus the share of the changes that brings it nearest to the truth.
        covariance = (filtered - changed - unfiltered).sum() / 2
        moment = weigh_pixels((self.changes.total[..., :3] / n) ** 2).sum()
        share = float(np.clip(-covariance / moment, 0, 1)) if moment > 0 else 1.0
        noise = (1 - share) * unfiltered + share * filtered - share * (1 - share) * changed
        bias = max(float(weigh_pixels(self.changes.shared_squares(n)).sum() / count), 0.0)
        return Estimate(n, trimmed_mean(noise, count), share**2 * bias, trimmed_mean(unfiltered, count), share)

    def mean(self, share: float = 1.0) -> Array:
        """Return the mean of the frames, float64 (H, W, 4), with this share of filtered light."""
        mean: Array = self.filtered.total / self.frames
        if self.unfiltered is not None and share < 1:
            mean = share * mean + (1 - share) * self.unfiltered.total / self.frames
        return mean
