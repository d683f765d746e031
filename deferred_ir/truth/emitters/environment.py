"""Light from all around, constant or by a latitude-longitude image as docs/conventions.md lays it out.

A bilinear image is a sum of tents, one on each texel. Directions are drawn from just that sum: a texel in proportion to
its luminance and the sine of its polar angle, then a place within its tent.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from deferred_ir.base.arrays import Array, Ints
from deferred_ir.rays.tracer import Hits
from deferred_ir.truth.emitters.base import LUMINANCE, TINY, Arriving, Twin, sample_cap


@dataclass(frozen=True, eq=False)
class EnvironmentTwin(Twin):
    """An environment."""

    can_be_met: ClassVar[bool] = True
    is_seen: ClassVar[bool] = True

    @cached_property
    def _image(self) -> _Image | None:
        return None if self.light.image is None else _Image(self.light.image.pixels)

    @cached_property
    def emission(self) -> Array:
        """Its radiance, or the factor on that of its image."""
        factor = (1.0, 1.0, 1.0) if self.light.radiance is None else self.light.radiance
        return np.asarray(factor) * float(self.light.scale)

    @property
    def power(self) -> float:
        """The luminous flux through discs about the scene that face it."""
        radiance = self.emission if self._image is None else self.emission * self._image.mean
        return float(4 * np.pi**2 * self.around.radius**2 * (LUMINANCE @ radiance))

    @property
    def spreads(self) -> bool:
        """It does."""
        return True

    def sample(self, at: Array, points: Array) -> Arriving:
        """Return what arrives from directions all around."""
        if self._image is None:
            to = sample_cap(points, np.broadcast_to([0.0, 0.0, 1.0], at.shape), 2.0)
        else:
            to = self._find_direction(self._image.draw(points))
        return Arriving(to, self.around.leave(at, to), *self._look(to))

    def meet(self, origins: Array, directions: Array, found: Hits) -> tuple[Array, Array]:
        """Return the radiance of rays that hit nothing."""
        del origins
        radiance, density = self._look(directions)
        radiance[found.hit] = 0
        return radiance, density

    def _look(self, directions: Array) -> tuple[Array, Array]:
        """Return radiance over emission in unit directions (n, 3), (n,) or (n, 3), and their density."""
        if self._image is None:
            return np.ones(len(directions)), np.full(len(directions), 1 / (4 * np.pi))
        x, y, z = directions.T
        u = (np.arctan2(x, -z) + np.radians(self.light.rotation)) / (2 * np.pi) + 0.5
        # The polar angle by half an arc tangent: an arc cosine is coarse near the poles.
        v = np.arctan2(np.hypot(x, z), y) / np.pi
        radiance, density = self._image.look_up(u, v)
        return radiance, density / (2 * np.pi**2 * np.maximum(np.sin(np.pi * v), TINY))

    def _find_direction(self, places: Array) -> Array:
        """Return unit directions (n, 3) to places (n, 2) of the image, u to the right and v down."""
        azimuth = 2 * np.pi * (places[:, 0] - 0.5) - np.radians(self.light.rotation)
        polar = np.pi * places[:, 1]
        return np.stack([np.sin(polar) * np.sin(azimuth), np.cos(polar), -np.sin(polar) * np.cos(azimuth)], axis=1)


class _Image:
    """A bilinear image, and places of it drawn in proportion to luminance times solid angle. pixels: (H, W, 3)."""

    def __init__(self, pixels: Any) -> None:
        self.pixels = pixels
        self.height, self.width = pixels.shape[:2]
        sines = np.sin(np.pi * (np.arange(self.height) + 0.5) / self.height)
        weights = (pixels.astype(np.float64) @ LUMINANCE) * sines[:, None]
        total = weights.sum()
        self.mean = (pixels * sines[:, None, None]).sum(axis=(0, 1), dtype=np.float64) / (self.width * sines.sum())
        self._density = weights * (weights.size / max(total, TINY))
        rows = weights.sum(axis=1)
        self._rows = _sum_chances(rows)
        self._columns = _sum_chances(weights)

    def look_up(self, u: Array, v: Array) -> tuple[Array, Array]:
        """Return the pixels (n, 3) at places u and v, and the density with which `draw` returns places there."""
        x, y = u * self.width - 0.5, v * self.height - 0.5
        left, top = np.floor(x).astype(np.int64), np.floor(y).astype(np.int64)
        across, down = x - left, y - top
        radiance, density = np.zeros((len(u), 3)), np.zeros(len(u))
        for column, part in ((left, 1 - across), (left + 1, across)):
            for row, share in ((top, 1 - down), (top + 1, down)):
                texel = np.clip(row, 0, self.height - 1), column % self.width
                radiance += self.pixels[texel] * (part * share)[:, None]
                density += self._density[texel] * (part * share)
        return radiance, density

    def draw(self, points: Array) -> Array:
        """Return places u and v, (n, 2), for points of the unit square (n, 2)."""
        none = np.zeros(len(points), np.int64)
        row, mark = _choose(self._rows[None], none, points[:, 1])
        column, rest = _choose(self._columns, row, points[:, 0])
        y = _draw_tent(mark)
        # Beyond the centres of the first and the last row the image is constant for half a texel.
        y = np.where((row == 0) & (mark < 0.5), mark - 0.5, y)
        y = np.where((row == self.height - 1) & (mark >= 0.5), mark - 0.5, y)
        return np.stack([(column + 0.5 + _draw_tent(rest)) / self.width, (row + 0.5 + y) / self.height], axis=1)


def _sum_chances(weights: Array) -> Array:
    """Return the running sums of weights along the last axis, over their total; all chances alike where that is 0."""
    sums = np.cumsum(weights, axis=-1)
    total = sums[..., -1:]
    alike = np.arange(1, weights.shape[-1] + 1) / weights.shape[-1]
    ends: Array = np.where(total > 0, sums / np.maximum(total, TINY), alike)
    return ends


def _choose(ends: Array, row: Ints, marks: Array) -> tuple[Ints, Array]:
    """Return in which cell of its `row` (n,) of running sums (h, w) a mark (n,) lies, and where in the cell, 0 to 1."""
    low, high = np.zeros(len(marks), np.int64), np.full(len(marks), ends.shape[1] - 1)
    while (low < high).any():  # a binary search in a row of its own for each mark
        middle = (low + high) // 2
        beyond = ends[row, middle] <= marks
        low, high = np.where(beyond, middle + 1, low), np.where(beyond, high, middle)
    before = np.where(low > 0, ends[row, low - 1], 0.0)
    part = (marks - before) / np.maximum(ends[row, low] - before, TINY)
    return low, np.clip(part, 0, 1)


def _draw_tent(marks: Array) -> Array:
    """Return places of the tent 1 - |x| by its distribution, for marks (n,) from 0 to 1."""
    places: Array = np.where(marks < 0.5, np.sqrt(2 * marks) - 1, 1 - np.sqrt(np.maximum(2 - 2 * marks, 0)))
    return places


TWIN = EnvironmentTwin
