"""How errors of an image are weighed: relMSE's denominator, and the mean without the worst pixels."""

from __future__ import annotations

import numpy as np

from deferred_ir.base.arrays import Array

EPSILON = 0.01
"""relMSE adds this times mean(R)^2 to R^2, so that dark pixels do not decide alone."""
TRIMMED = 0.001
"""Fraction of the pixels, the worst ones, that trimmed relMSE leaves out."""


def weigh(reference: Array, mean: float) -> Array:
    """Return what squared errors are divided by, R^2 + EPSILON mean(R)^2, in the shape of `reference`."""
    weights: Array = reference**2 + EPSILON * mean**2
    return weights


def count_kept(count: int) -> int:
    """Return how many of `count` pixels, the best ones, a trimmed mean is over; one at least."""
    return max(1, int(count * (1 - TRIMMED)))


def trimmed_mean(errors: Array, count: int) -> float:
    """Return the mean of `errors` over `count` pixels without the worst; the rest of the pixels holds zeros."""
    kept = count_kept(count)
    left = errors.size - (count - kept)
    return float(np.partition(errors, left - 1, axis=None)[:left].sum() / kept)
