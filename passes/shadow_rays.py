"""Ask by shadow rays which of its share of the VPLs each pixel sees: vpls, G-buffer -> masks.

Interleaved, a pixel asks so few VPLs that exact rays can cost less than a map of the whole scene for each. The G-buffer
is read back, Embree traces on the CPU, and the answers go up as bits.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from deferred_ir.frame import Frame
from deferred_ir.graph import Buffer, Description, Facts, Input, Output, Pass, Texture
from deferred_ir.interleaving import deal, places
from deferred_ir.io import Io
from deferred_ir.params import param
from deferred_ir.ray_visibility import BITS, cost_of_maps, cost_of_rays, masks
from deferred_ir.surfaces import from_gbuffer


@dataclass(frozen=True)
class Params:
    """Parameters of visibility by rays."""

    visibility: Literal["auto", "maps", "rays"] = param(
        "auto", doc="Whether VPLs' shadows come from maps or from rays; auto: from what should take less time."
    )


class ShadowRays(Pass):
    """Which VPLs of its share a pixel sees."""

    Params = Params
    inputs: ClassVar[Mapping[str, Input]] = {
        "vpls": Input("the VPLs in the order of their shares", format="share"),
        "depth": Input("reversed depth", format="depth32f"),
        "normals": Input("shading and geometric normal", format="rgba16"),
    }

    def outputs(self, inputs: Mapping[str, Description | None]) -> Mapping[str, Output]:
        """A layer for each 32 VPLs of a share."""
        vpls = inputs["vpls"]
        assert isinstance(vpls, Buffer)
        layers = -(-vpls.records // (vpls.parts * BITS))
        doc = "bit b of layer w: whether the pixel sees VPL 32 w + b of its share; in sub-buffers"
        return {"masks": Output(doc, Texture("r32ui", layers=layers), attach=False)}

    def unneeded(self, facts: Facts) -> str | None:
        """Where maps are chosen, or cost less."""
        if not facts.emits:
            return "the spotlight emits nothing"
        if self.params.visibility == "maps":
            return "visibility is 'maps'"
        maps, rays = cost_of_maps(facts), cost_of_rays(facts)
        if self.params.visibility == "rays" or rays < maps:
            return None
        return f"maps should take less time: {maps:.2g} ms for each VPL, rays {rays:.2g} ms"

    def execute(self, frame: Frame, io: Io) -> None:
        """Read back, trace, upload."""
        vpls, parts = io["vpls"].records, io["vpls"].description.parts
        scene = frame.scene
        seen = from_gbuffer(
            scene.camera,
            frame.near,
            io["depth"].read()[..., 0],
            io["normals"].read(),
            smooth=scene.geometry.normals is not None,
        )
        share, place = places(seen.pixel, frame.size, round(parts**0.5))
        starts = deal(len(vpls), round(parts**0.5))[1]
        shares = [(np.flatnonzero(share == i), slice(int(starts[i]), int(starts[i + 1]))) for i in range(parts)]
        words, _ = masks(frame.tracer(), seen, vpls, shares)
        width, height = frame.size
        image = np.zeros((io["masks"].description.layers, height * width), np.uint32)
        image[: len(words), place] = words
        io["masks"].upload(image.reshape(-1, height, width, 1))


PASS = ShadowRays
