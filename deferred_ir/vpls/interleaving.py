"""Interleaved sampling (Keller and Heidrich 2001): which VPLs light which pixels, and where those pixels stand.

Each pixel of an n x n block is lit by a share of the VPLs. Pixels with the same share stand together in a sub-buffer
(Segovia et al. 2006), so that one draw with one list of lights serves them all: pixel (x, y) has the share
(y mod n) n + x mod n. shaders/lib/shares/places.glsl finds the same places.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from deferred_ir.base.arrays import Ints

SHUFFLE = 8191
"""Seed of the permutation, the same in every frame."""


@dataclass(frozen=True)
class SharesMeta:
    """How VPLs are dealt. n: edge of a block of pixels, each of which is lit by one of n^2 shares."""

    n: int


def dealt(slots: Ints, capacity: int) -> Ints:
    """In which order VPLs are dealt to the shares: int (n,), of VPLs with `slots` (n,) out of `capacity`, each its own.

    Shuffled, so that what is left of the pattern has no structure, and by slots: where VPLs come and go, those that
    stay keep their order, and all but a few their shares.
    """
    ranks = np.empty(capacity, np.intp)
    ranks[np.random.Generator(np.random.PCG64(SHUFFLE)).permutation(capacity)] = np.arange(capacity)
    return np.argsort(ranks[slots])


def share_starts(count: int, n: int) -> Ints:
    """Where the n^2 shares of `count` VPLs begin and the last ends, int (n^2 + 1,); they differ by one at most."""
    begins: Ints = np.arange(n * n + 1) * count // (n * n)
    return begins


def sub_buffers(size: tuple[int, int], n: int) -> list[tuple[int, int, int, int]]:
    """Rectangle (x, y, width, height) of each share in a texture of `size`; one may be a pixel larger than the next."""
    columns, rows = (_parts(length, n) for length in size)
    return [(x, y, width, height) for y, height in rows for x, width in columns]


def places(pixel: Ints, size: tuple[int, int], n: int) -> tuple[Ints, Ints]:
    """The shares of pixels (m,), numbered row by row, and where they stand in the texture of sub-buffers, int (m,)."""
    width, height = size
    y, x = np.divmod(pixel, width)
    columns, rows = (np.array([start for start, _ in _parts(length, n)]) for length in (width, height))
    return y % n * n + x % n, (rows[y % n] + y // n) * width + columns[x % n] + x // n


def _parts(length: int, n: int) -> list[tuple[int, int]]:
    """Start and length of the part that holds every n-th of `length` pixels, for each of the n offsets."""
    whole, rest = divmod(length, n)
    return [(i * whole + min(i, rest), whole + (i < rest)) for i in range(n)]
