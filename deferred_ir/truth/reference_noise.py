"""How large an error a reference itself has, and what that leaves of an error measured against it.

A reference of N paths a pixel is not exact: against the exact image it has a relMSE of its own, its noise. Where image
and reference are independent, the relMSE between them is on average the sum of the two. So a figure below twice the
noise is mostly noise, and tells only that the image's own error is smaller than the noise.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

MOST = 0.1
"""Most noise of a reference as a fraction of a measured error; figures with more are flagged."""
NOISY, BELOW = "reference_noise", "below_noise"
"""Flags of measured errors: the noise is unknown or more than MOST of it; or it is most of it."""


@dataclass(frozen=True)
class ReferenceNoise:
    """A reference's own relMSE (untrimmed, over all pixels that show a surface), None if unknown.

    how: what tells it, "from the spread of its 256 paths a pixel", or why nothing does.
    """

    relmse: float | None
    how: str

    @classmethod
    def from_metadata(cls, metadata: Mapping[str, Any]) -> ReferenceNoise:
        """Read what `deferred-ir reference` wrote beside its image; {} for an image without metadata."""
        value = metadata.get("noise")
        if isinstance(value, bool) or not isinstance(value, int | float) or not 0 <= value < math.inf:
            why = metadata.get("note") or ("its metadata do not tell it" if metadata else "it has no metadata")
            return cls(None, str(why))
        paths = metadata.get("spp")
        return cls(float(value), f"from the spread of its {paths} paths a pixel" if paths else "as its metadata say")

    def flag(self, error: float) -> str:
        """Return BELOW, NOISY or "" for a relMSE measured against this reference."""
        if self.relmse is None:
            return NOISY
        if self.hides(error):
            return BELOW
        return NOISY if self.relmse > MOST * error else ""

    def hides(self, error: float) -> bool:
        """Return whether the noise is more than half of a measured relMSE."""
        return self.relmse is not None and self.relmse > 0 and error < 2 * self.relmse

    def level(self, error: float) -> float:
        """Return the relMSE for comparisons with others: all that the noise hides are alike."""
        return max(error, 2 * self.relmse) if self.relmse is not None else error

    def quote(self, error: float, digits: int = 3) -> str:
        """Format a measured relMSE; one that the noise hides as the bound that it is, "< 0.0026"."""
        if self.relmse is not None and self.hides(error):
            return f"< {self.relmse:.2g}"
        return f"{error:.{digits}g}"
