"""Closed forms of what the light model says, for tests to hold results against."""

from __future__ import annotations

import math


def mean_cone_factor(fov: float) -> float:
    """Return the mean of a spotlight's cone factor over the disc of directions, by its closed form.

    With s = 1 - cos theta and e = 1 - cos(fov/2) the disc's area element is 2 pi (1 - s) ds, the factor 1 up to 3e/4
    and 4 (1 - s/e) from there to e.
    """
    e = 2 * math.sin(math.radians(fov) / 4) ** 2
    flat = 0.75 * e - (0.75 * e) ** 2 / 2
    edge = 4 * ((e - e**2 / 2 - flat) - ((e**2 / 2 - e**3 / 3) - ((0.75 * e) ** 2 / 2 - (0.75 * e) ** 3 / 3)) / e)
    return (flat + edge) / (e - e**2 / 2)
