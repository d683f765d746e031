"""Process-wide unique version numbers; a resource takes a new one whenever its contents change."""

from __future__ import annotations

import itertools

import numpy as np

from deferred_ir.base.arrays import Ints

_numbers = itertools.count(1)


def new_version() -> int:
    """Return a version number above 0 that was never given out before."""
    return next(_numbers)


def new_versions(count: int) -> Ints:
    """Return `count` new version numbers, int (count,)."""
    return np.fromiter(_numbers, np.int64, count)
