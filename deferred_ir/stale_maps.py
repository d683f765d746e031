"""Kept maps that show a moving model where it was, and the order in which they are drawn anew."""

from __future__ import annotations

import numpy as np

from .geometry import Geometry
from .typing import Array, Bools, Ints


class StaleMaps:
    """Of each of `count` slots, whether its map is stale, and since when it has been as it is."""

    def __init__(self, count: int) -> None:
        self.stale = np.zeros(count, bool)
        self._drawn = np.zeros(count, np.int64)
        self._frame = 0
        self._before: Geometry | None = None
        self._boxes: Array = np.zeros((0, 2, 3))

    def follow(self, geometry: Geometry) -> Bools:
        """Begin a frame: which of the moving models are elsewhere than in the last one, bool (m,)."""
        before, self._before = self._before, geometry
        self._frame += 1
        if before is None or before is geometry:
            self._boxes = self._boxes[:0]
            return np.zeros(len(geometry.moving), bool)
        moved: Bools = (before.poses != geometry.poses).any(axis=(1, 2))
        self._boxes = np.concatenate([before.boxes[moved], geometry.boxes[moved]])
        return moved

    def see(self, positions: Array, axes: Array) -> Bools:
        """In front of which lights at `positions` along `axes` (n, 3) a model has moved in this frame, bool (n,)."""
        seen = np.zeros(len(positions), bool)
        for low, high in self._boxes:
            farthest = ((low + high) / 2 - positions) * axes + (high - low) / 2 * np.abs(axes)
            seen |= farthest.sum(axis=1) > 0
        return seen

    def drawn(self, slots: Ints) -> None:
        """The maps of `slots` are drawn in this frame."""
        self.stale[slots] = False
        self._drawn[slots] = self._frame

    def oldest(self, slots: Ints, most: int) -> Ints:
        """Up to `most` of the stale maps among `slots`, int (m,): those drawn longest ago."""
        stale = slots[self.stale[slots]]
        return stale[np.argsort(self._drawn[stale], kind="stable")[: max(most, 0)]]
