"""Numbers that tell whether something is still what it was: a new one for whatever is new, never the same twice."""

from __future__ import annotations

import itertools

import numpy as np

from deferred_ir.base.arrays import Ints

_numbers = itertools.count(1)


def new_version() -> int:
    """A number that no other thing has; above 0."""
    return next(_numbers)


def new_versions(count: int) -> Ints:
    """So many of them, int (count,)."""
    return np.fromiter(_numbers, np.int64, count)
