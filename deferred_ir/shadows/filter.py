"""Parameters of passes that read shadow maps: how a comparison is filtered, and where it is made.

They belong to the reader. Another filter draws no map again, and compiles only programs that compare.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from deferred_ir.graph.params import param

Defines = dict[str, int | float]


@dataclass(frozen=True)
class SpotFilter:
    """How the spotlight's map is filtered."""

    spot_offset: float = param(
        0.1,
        lo=0.0,
        hi=16.0,
        doc="How far a point is lifted off its face before it is compared with the spotlight's map, texels.",
        formerly="shadow_maps.spot_offset",
    )
    spot_kernel: float = param(
        1.0,
        lo=1.0,
        hi=64.0,
        doc="Filter of the spotlight's map: width in texels. 1: the hardware's 2x2 alone.",
        formerly="shadow_maps.spot_kernel",
    )
    spot_taps: int = param(
        16,
        lo=1,
        hi=256,
        doc="Comparisons that a wider filter spreads over the spotlight's map.",
        formerly="shadow_maps.spot_taps",
    )
    soft: Literal["pcss", "off"] = param(
        "pcss",
        doc="Shadows of a spotlight with a radius: percentage-closer soft shadows, or hard ones.",
        formerly="shadow_maps.soft",
    )
    search_taps: int = param(
        16,
        lo=1,
        hi=256,
        doc="Soft shadows: depths read in each of two searches for blockers.",
        formerly="shadow_maps.search_taps",
    )
    soft_taps: int = param(
        32,
        lo=1,
        hi=256,
        doc="Soft shadows: comparisons spread over the penumbra.",
        formerly="shadow_maps.soft_taps",
    )

    def spot_defines(self) -> Defines:
        """Return the defines of shaders that ask for the spotlight's visibility."""
        return {
            "SPOT_OFFSET": float(self.spot_offset),
            "SPOT_KERNEL": float(self.spot_kernel),
            "SPOT_TAPS": self.spot_taps,
            "SOFT": int(self.soft == "pcss"),
            "SEARCH_TAPS": self.search_taps,
            "SOFT_TAPS": self.soft_taps,
        }


@dataclass(frozen=True)
class VplFilter:
    """How the maps of VPLs are filtered."""

    vpl_offset: float = param(
        0.25,
        lo=0.0,
        hi=16.0,
        doc="How far a point is lifted off its face before it is compared with a VPL's map, texels.",
        formerly="shadow_maps.vpl_offset",
    )
    vpl_kernel: float = param(
        1.0,
        lo=1.0,
        hi=64.0,
        doc="Filter of a VPL's map: width in texels. 1: the hardware's 2x2 alone.",
        formerly="shadow_maps.vpl_kernel",
    )
    vpl_taps: int = param(
        8,
        lo=1,
        hi=256,
        doc="Comparisons that a wider filter spreads over a VPL's map.",
        formerly="shadow_maps.vpl_taps",
    )

    def vpl_defines(self) -> Defines:
        """Return the defines of shaders that ask for a VPL's visibility."""
        return {
            "VPL_OFFSET": float(self.vpl_offset),
            "VPL_KERNEL": float(self.vpl_kernel),
            "VPL_TAPS": self.vpl_taps,
        }


@dataclass(frozen=True)
class ShadowFilter(VplFilter, SpotFilter):
    """How all shadow maps are filtered."""

    def defines(self) -> Defines:
        """Return the defines of shaders that ask for the visibility of any light."""
        return self.spot_defines() | self.vpl_defines()
