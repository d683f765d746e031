"""Distance between images, straight from its definition, for tests that must not rely on the package's own."""

from __future__ import annotations

from typing import Any

import numpy as np


def rel_mse(image: np.ndarray, reference: np.ndarray, hit: np.ndarray, trim: float = 0.0) -> float:
    """Mean over hit pixels (H, W) and RGB of (I - R)^2 / (R^2 + 0.01 mean(R)^2), without the worst `trim` of pixels."""
    image, reference = image[hit].astype(np.float64), reference[hit].astype(np.float64)
    error = ((image - reference) ** 2 / (reference**2 + 0.01 * reference.mean() ** 2)).mean(axis=-1)
    return float(np.sort(error)[: len(error) - int(len(error) * trim)].mean())


def share_off(image: np.ndarray, reference: np.ndarray, hit: np.ndarray, tolerance: float = 0.01) -> float:
    """Share of hit pixels that are off by more than `tolerance` of max(reference, 1 % of its mean) in any channel."""
    image, reference = image[hit].astype(np.float64), reference[hit].astype(np.float64)
    off = np.abs(image - reference) > tolerance * np.maximum(reference, 0.01 * reference.mean())
    return float(off.any(axis=-1).mean())


def assert_same_but_for_edges(image: np.ndarray, reference: np.ndarray) -> None:
    """The same up to rounding, which may move the edge of a hard shadow past the centre of a pixel in a thousand."""
    everywhere = np.ones(image.shape[:2], bool)
    assert reference.mean() > 0
    assert share_off(image, reference, everywhere) < 1e-3
    assert rel_mse(image, reference, everywhere, trim=1e-3) < 1e-7


def same_pixels(one: Any, other: Any) -> bool:
    """Whether two rendered images are equal to the last bit, radiance and display alike."""
    return np.array_equal(one.radiance, other.radiance) and np.array_equal(one.display, other.display)
