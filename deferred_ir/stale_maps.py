"""Kept maps that show a moving model where it was, and the order in which they are drawn anew."""

from __future__ import annotations

from collections.abc import Mapping

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

    def follow(self, geometry: Geometry) -> Mapping[int, Array]:
        """Begin a frame: the rigid transforms (4, 4) of the moving models that are elsewhere than in the last one."""
        before, self._before = self._before, geometry
        self._frame += 1
        self._boxes = self._boxes[:0]
        if before is None or before is geometry:
            return {}
        moved = np.flatnonzero((before.poses != geometry.poses).any(axis=(1, 2)))
        self._boxes = np.concatenate([before.boxes[moved], geometry.boxes[moved]])
        return {number: geometry.poses[number] @ np.linalg.inv(before.poses[number]) for number in moved.tolist()}

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

    def chosen(self, lag: Array, most: int) -> Ints:
        """Up to `most` stale maps to draw, int (m,): half of them those that are most behind by `lag`, (slots,).

        The rest are those drawn longest ago.
        """
        stale = np.flatnonzero(self.stale)
        behind = stale[np.argsort(-lag[stale], kind="stable")]
        first = behind[lag[behind] > 0][: (max(most, 0) + 1) // 2]
        rest = np.setdiff1d(stale, first)
        oldest = rest[np.argsort(self._drawn[rest], kind="stable")]
        return np.concatenate([first, oldest[: max(most, 0) - len(first)]])
