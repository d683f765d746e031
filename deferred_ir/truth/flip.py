"""Measure HDR-FLIP, the difference that a viewer sees, with the optional package flip-evaluator.

The package needs care: it ends the whole process if it finds no exposures (for a reference that is black, or nearly),
raises SystemExit on arguments that it refuses, returns 0 for a single exposure and hides values that are not finite. So
exposures are always passed, and images are scaled to a range that its 32-bit floats hold.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from deferred_ir.base.arrays import Array
from deferred_ir.base.colour import LUMINANCE
from deferred_ir.base.errors import SettingError

PIXELS_PER_DEGREE = 3840 * math.pi / 180
"""FLIP's own choice: a 0.7 m wide screen of 3840 pixels, seen from 0.7 m."""
ACES = ((0.9036, 0.018, 0.0), (0.8748, 0.354, 0.14))
"""The tone curve that FLIP applies: numerator and denominator, by falling powers."""
BRIGHT = 0.85
"""ACES' output for the brightest pixel at the start exposure, and for the median pixel at the stop exposure."""
STOPS = 60
"""Stops beyond white at which brighter pixels are clamped, so that no exposure makes them infinite."""
WIDEST = 40
"""Most stops between the exposures: more than any display shows, and 20 below STOPS, so that white stays white."""


@dataclass(frozen=True)
class FlipParameters:
    """Parameters of FLIP: first and last exposure in stops, the number of exposures, and the viewing conditions."""

    start_exposure: float
    stop_exposure: float
    exposures: int
    pixels_per_degree: float = PIXELS_PER_DEGREE
    tonemapper: str = "aces"

    def __post_init__(self) -> None:
        finite = math.isfinite(self.start_exposure) and math.isfinite(self.stop_exposure)
        if not finite or not 0 <= self.stop_exposure - self.start_exposure <= WIDEST or self.exposures < 2:
            raise SettingError(f"FLIP: {self}: wants 0 to {WIDEST} stops from start to stop, and 2 exposures at least")

    @classmethod
    def from_reference(cls, reference: Array) -> FlipParameters:
        """Choose exposures for a reference (H, W, 3) by the rule of HDR-FLIP; use them for all images compared with it.

        The median is that of the pixels above 0, since a black median would leave no last exposure; of an even number
        it is the upper one, as in flip-evaluator. Raises SettingError if the reference is black.
        """
        luminance = np.asarray(reference, np.float64) @ LUMINANCE
        lit = np.sort(luminance[luminance > 0])
        if lit.size == 0:
            raise SettingError("FLIP: the reference is black, there is no exposure that shows it")
        numerator, denominator = np.array(ACES)
        white = np.roots(numerator - BRIGHT * denominator).real.max()
        start, stop = (float(math.log2(white / value)) for value in (lit[-1], lit[lit.size // 2]))
        stop = min(stop, start + WIDEST)
        return cls(start, stop, max(2, math.ceil(stop - start)))


def find_obstacle(image: Array, reference: Array, names: tuple[str, str]) -> str | None:
    """Return why FLIP cannot be measured on these two images, which the text calls `names`, or None if it can."""
    for array, name in zip((image, reference), names, strict=True):
        below = int((array < 0).any(-1).sum())
        if below:
            return f"FLIP takes no radiance below 0, which {below} pixels of {name} have"
    try:
        import flip_evaluator
    except ImportError as error:
        return f"{' '.join(str(error).split())}; pip install 'deferred-ir[report]'"
    del flip_evaluator
    return None


def measure_flip(image: Array, reference: Array, parameters: FlipParameters) -> float:
    """Return the mean of HDR-FLIP's map over the whole picture, background included: 0 for equal images, 1 at most.

    Both images are (H, W, 3), finite, at least 0 and of the same size.
    """
    import flip_evaluator

    span = parameters.stop_exposure - parameters.start_exposure
    options: dict[str, Any] = {
        "ppd": parameters.pixels_per_degree,
        "startExposure": 0.0,
        "stopExposure": span,
        "numExposures": parameters.exposures,
        "tonemapper": parameters.tonemapper,
    }
    exposed = (_expose(array, parameters.start_exposure, 2.0 ** (STOPS - span)) for array in (reference, image))
    try:
        _, mean, _ = flip_evaluator.evaluate(*exposed, "HDR", applyMagma=False, parameters=options)
    except SystemExit as end:
        raise SettingError(f"FLIP: flip-evaluator refuses {parameters}") from end
    return float(mean)


def _expose(image: Array, stops: float, white: float) -> Any:
    """Return `image` at an exposure, clamped to `white`, in the layout that flip-evaluator reads."""
    exposed = np.asarray(image, np.float64) * 2.0**stops
    return np.ascontiguousarray(np.minimum(exposed, white), np.float32)
