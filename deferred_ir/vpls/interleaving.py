"""Interleaved sampling (Keller and Heidrich 2001): which VPLs light which pixels, and where those pixels stand.

The pixels of an n x n block divide the VPLs among them: each is lit by a share of its own, n^2 shares in all. Pixels
with the same share stand together in a sub-buffer (Segovia et al. 2006), so that one draw with one list of lights
serves them all. Pixel (x, y) has share (y mod n) n + x mod n; shaders/lib/shares/places.glsl finds the same places.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from deferred_ir.base.arrays import Ints

SHUFFLE = 8191
"""Seed of the permutation, the same in every frame."""


@dataclass(frozen=True)
class SharesMeta:
    """The size of a block. n: pixels along an edge; each pixel is lit by one of n^2 shares."""

    n: int


def deal(slots: Ints, capacity: int, points: int = 0) -> Ints:
    """Return the order in which VPLs are dealt to the shares, int (n,).

    slots: int (n,), different numbers below `capacity`, one for each VPL. The order is shuffled, so that what a share
    takes of the sample pattern has no structure, and it goes by slots: where VPLs come and go, the others keep their
    order, and all but a few their shares. Slots below `points` are dealt by themselves: each share gets as many.
    """
    first = np.flatnonzero(slots < points)
    if not len(first):
        return _shuffle(slots - points, capacity - points)
    others = np.flatnonzero(slots >= points)
    first = first[_shuffle(slots[first], points)]
    others = others[_shuffle(slots[others] - points, capacity - points)]
    # Both evenly from beginning to end.
    place = np.concatenate([(np.arange(len(part)) + 0.5) / max(len(part), 1) for part in (first, others)])
    return np.concatenate([first, others])[np.argsort(place, kind="stable")]


def _shuffle(slots: Ints, capacity: int) -> Ints:
    """Return the order of `slots` (n,) in a permutation of all `capacity` of them, int (n,)."""
    ranks = np.empty(capacity, np.intp)
    ranks[np.random.Generator(np.random.PCG64(SHUFFLE)).permutation(capacity)] = np.arange(capacity)
    return np.argsort(ranks[slots])


def find_share_starts(count: int, n: int) -> Ints:
    """Return where each of the n^2 shares of `count` VPLs starts, and where the last ends, int (n^2 + 1,).

    Their sizes differ by one at most.
    """
    starts: Ints = np.arange(n * n + 1) * count // (n * n)
    return starts


def find_sub_buffers(size: tuple[int, int], n: int) -> list[tuple[int, int, int, int]]:
    """Return each share's rectangle (x, y, width, height) in a texture of `size` (width, height).

    Where n does not divide the size, some are a pixel larger than others.
    """
    columns, rows = (_split(length, n) for length in size)
    return [(x, y, width, height) for y, height in rows for x, width in columns]


def find_places(pixel: Ints, size: tuple[int, int], n: int) -> tuple[Ints, Ints]:
    """Return the shares of pixels (m,), and where those pixels stand in the texture of sub-buffers, both int (m,).

    pixel: row * width + column in an image of `size` (width, height). The places are numbered in the same way.
    """
    width, height = size
    y, x = np.divmod(pixel, width)
    columns, rows = (np.array([start for start, _ in _split(length, n)]) for length in (width, height))
    return y % n * n + x % n, (rows[y % n] + y // n) * width + columns[x % n] + x // n


def sort_lonely_list(texels: Ints) -> Ints:
    """Return the entries of a list of lonely pixels in their order, (H * W, channels).

    texels: (H, W, channels), as the texture has them (shaders/lib/shares/lonely.glsl): pairs of rows, column by column.
    """
    height, width, channels = texels.shape
    paired = texels[: height // 2 * 2].reshape(-1, 2, width, channels).swapaxes(1, 2)
    return np.concatenate([paired.reshape(-1, channels), texels[height // 2 * 2 :].reshape(-1, channels)])


def choose_window_side(seed: int) -> tuple[int, int]:
    """Return on which side in x and in y the filter's even window has a pixel more: 0 before its centre, 1 behind it.

    Frames with fresh seeds go through all four, so that their mean is not off centre.
    """
    return seed & 1, seed >> 1 & 1


def _split(length: int, n: int) -> list[tuple[int, int]]:
    """Return start and length of the interval that holds every n-th of `length` pixels, for each of the n offsets."""
    whole, rest = divmod(length, n)
    return [(i * whole + min(i, rest), whole + (i < rest)) for i in range(n)]
