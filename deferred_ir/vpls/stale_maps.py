"""Kept maps that show a moving model where it was, and the order in which they are drawn anew."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from deferred_ir.base.arrays import Array, Bools, Ints
from deferred_ir.scene.geometry import Geometry

TURNED = 0.01
"""Of its size: how far a model counts as moved besides, for it may have turned in its place."""
TINY = 1e-300
CARRIED = 8.0
"""So much more wrong is the map of a light that moved itself, for all that it sees has moved."""


class StaleMaps:
    """Of each of `count` slots, whether its map is stale, and how much it is: `wrong`, in no unit."""

    def __init__(self, count: int) -> None:
        self.stale = np.zeros(count, bool)
        self.wrong = np.zeros(count)
        self._before: Geometry | None = None
        self._boxes: Array = np.zeros((2, 0, 2, 3))

    def follow(self, geometry: Geometry) -> Mapping[int, Array]:
        """Begin a frame: the rigid transforms (4, 4) of the moving models that are elsewhere than in the last one."""
        before, self._before = self._before, geometry
        self._boxes = self._boxes[:, :0]
        if before is None or before is geometry:
            return {}
        moved = np.flatnonzero((before.poses != geometry.poses).any(axis=(1, 2)))
        self._boxes = np.stack([before.boxes[moved], geometry.boxes[moved]])
        return {number: geometry.poses[number] @ np.linalg.inv(before.poses[number]) for number in moved.tolist()}

    def see(self, positions: Array, axes: Array) -> Bools:
        """In front of which lights at `positions` along `axes` (n, 3) a model has moved in this frame, bool (n,)."""
        seen = np.zeros(len(positions), bool)
        for low, high in self._boxes.reshape(-1, 2, 3):
            farthest = ((low + high) / 2 - positions) * axes + (high - low) / 2 * np.abs(axes)
            seen |= farthest.sum(axis=1) > 0
        return seen

    def age(self, seen: Bools, carried: Bools, positions: Array) -> None:
        """Make maps more wrong: those that have `seen` models move, and those that moved with one, (slots,) each.

        By how far the models' boxes moved and how large they look; positions: of the lights (slots, 3).
        """
        self.stale |= seen | carried
        for before, now in self._boxes.swapaxes(0, 1):
            size = np.linalg.norm(now[1] - now[0])
            way = np.abs(now - before).max() + TURNED * size
            square = np.maximum(((now.mean(axis=0) - positions) ** 2).sum(axis=1), size**2 + TINY)
            self.wrong += way * size / square * np.where(carried, CARRIED, seen)

    def drawn(self, slots: Ints) -> None:
        """The maps of `slots` are drawn in this frame."""
        self.stale[slots] = False
        self.wrong[slots] = 0

    def worst(self, power: Array, most: int) -> Ints:
        """Up to `most` stale maps, int (m,), that do most harm: how wrong they are, times the lights' `power`."""
        stale = np.flatnonzero(self.stale)
        return stale[np.argsort(-(self.wrong * power)[stale], kind="stable")[: max(most, 0)]]
