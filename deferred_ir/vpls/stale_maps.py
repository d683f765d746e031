"""Shadow maps that show a moving model where it was, and the order in which they are redrawn."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from deferred_ir.base.arrays import Array, Bools, Ints
from deferred_ir.scene.geometry import Geometry

ROTATED = 0.01
"""Added to a model's displacement, as a fraction of its size: it may have rotated in place."""
TINY = 1e-300
"""Keeps squared distances off 0."""
MOVED_ALONG = 8.0
"""Factor on the error of a map whose own light moved: everything in it is displaced."""


class ModelMoves:
    """Which models moved from frame to frame, and in front of which lights."""

    def __init__(self) -> None:
        self._before: Geometry | None = None
        self._boxes: Array = np.zeros((2, 0, 2, 3))

    def follow(self, geometry: Geometry) -> Mapping[int, Array]:
        """Begin a frame. Returns the rigid motion (4, 4) since the last one of each model that moved, by its number."""
        before, self._before = self._before, geometry
        self._boxes = self._boxes[:, :0]
        if before is None or before is geometry:
            return {}
        moved = np.flatnonzero((before.poses != geometry.poses).any(axis=(1, 2)))
        self._boxes = np.stack([before.boxes[moved], geometry.boxes[moved]])
        return {number: geometry.poses[number] @ np.linalg.inv(before.poses[number]) for number in moved.tolist()}

    def find_changed(self, positions: Array, axes: Array) -> Bools:
        """Return whether a model moved in front of lights at `positions` (n, 3) along `axes` (n, 3), bool (n,)."""
        changed = np.zeros(len(positions), bool)
        for low, high in self._boxes.reshape(-1, 2, 3):
            farthest = ((low + high) / 2 - positions) * axes + (high - low) / 2 * np.abs(axes)
            changed |= farthest.sum(axis=1) > 0
        return changed


class StaleMaps(ModelMoves):
    """Staleness of the maps of `count` slots.

    stale: whether a map must be redrawn, bool (count,). error: how far off it is, (count,), in no unit.
    """

    def __init__(self, count: int) -> None:
        super().__init__()
        self.stale = np.zeros(count, bool)
        self.error = np.zeros(count)

    def age(self, changed: Bools, moved_along: Bools, positions: Array) -> None:
        """Add this frame's motion to the maps' errors, by how far models' boxes moved and how large they look.

        changed: maps of lights before which a model moved, (slots,). moved_along: maps of lights that moved with a
        model, (slots,). positions: of the lights, (slots, 3).
        """
        self.stale |= changed | moved_along
        for before, now in self._boxes.swapaxes(0, 1):
            size = np.linalg.norm(now[1] - now[0])
            way = np.abs(now - before).max() + ROTATED * size
            square = np.maximum(((now.mean(axis=0) - positions) ** 2).sum(axis=1), size**2 + TINY)
            self.error += way * size / square * np.where(moved_along, MOVED_ALONG, changed)

    def mark_drawn(self, slots: Ints) -> None:
        """Note that the maps of `slots` are drawn in this frame."""
        self.stale[slots] = False
        self.error[slots] = 0

    def find_worst(self, power: Array, most: int) -> Ints:
        """Return the slots of up to `most` stale maps, int (m,), by falling error times the lights' `power`."""
        stale = np.flatnonzero(self.stale)
        return stale[np.argsort(-(self.error * power)[stale], kind="stable")[: max(most, 0)]]
