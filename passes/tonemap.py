"""Convert radiance to display pixels: exposure, tone curve, sRGB. No other file does so.

Curves: Khronos PBR Neutral (specification of 2024), Reinhard et al. 2002, ACES as fitted by Narkowicz 2015.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Literal, get_args

from deferred_ir.frame.frame import Frame
from deferred_ir.frame.fullscreen import FullscreenPass
from deferred_ir.gl.shaders import Define
from deferred_ir.graph.params import param
from deferred_ir.graph.ports import Description, Input, Output, Texture

Operator = Literal["neutral", "reinhard", "aces", "none"]


@dataclass(frozen=True)
class Params:
    """Parameters of the display transform."""

    operator: Operator = param("neutral", doc="Tone curve; none clips.")
    exposure: float | Literal["auto"] = param(
        "auto",
        lo=-64.0,
        hi=64.0,
        role="exposure",
        doc="Stops; auto brings the mean luminance of lit surfaces to middle grey.",
    )


class Tonemap(FullscreenPass):
    """Exposure, tone curve, sRGB encoding, 8 bits."""

    Params = Params
    inputs: ClassVar[Mapping[str, Input]] = {"radiance": Input("linear radiance", format="rgba32f")}
    fragment = "tonemap/tonemap.frag"
    vertex = "tonemap/exposure.vert"

    def outputs(self, inputs: Mapping[str, Description | None]) -> Mapping[str, Output]:
        """Return one texture of the frame's size."""
        del inputs
        return {"color": Output("sRGB-encoded display colour", Texture("rgba8"))}

    def depends(self) -> frozenset[str]:
        """Nothing of the frame."""
        return frozenset()

    def defines(self, frame: Frame) -> Mapping[str, Define]:
        """Choose the operator and the kind of exposure at compile time, unless the graph keeps all variants."""
        given = self.uniforms()
        chosen = {"OPERATOR": given["operator_number"], "AUTOMATIC": int(given["automatic"])}
        return {} if frame.keep_all else chosen

    def uniforms(self) -> Mapping[str, Any]:
        """Return the operator's number, and the exposure as a factor."""
        auto = self.params.exposure == "auto"
        return {
            "operator_number": get_args(Operator).index(self.params.operator),
            "automatic": auto,
            "scale": 1.0 if auto else 2.0**self.params.exposure,
        }


PASS = Tonemap
