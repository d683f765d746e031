"""Types that many signatures share, and sums of points."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Vec3 = tuple[float, float, float]
Array = NDArray[np.floating[Any]]
Ints = NDArray[np.integer[Any]]
Bools = NDArray[np.bool_]


def add_vec3(a: Vec3, b: Vec3) -> Vec3:
    """Return a + b."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]
