"""Find by shadow rays which lights each pixel sees: vpls, G-buffer -> masks, one bit a VPL of its share; direct.

Interleaved, a pixel asks so few VPLs that on the CPU exact rays can cost less than a map of the whole scene for each.
The G-buffer is read back, Embree traces, and the answers go up. Direct lights are asked, too: no light needs a map.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from deferred_ir.frame.direct_lights import describe_direct
from deferred_ir.frame.facts import DIRECT_LIGHTS, EMITS
from deferred_ir.frame.frame import Frame
from deferred_ir.frame.pass_io import Io
from deferred_ir.frame.vpl_buffer import read_limits, read_vpls
from deferred_ir.graph.facts import NOTHING_KNOWN, Facts
from deferred_ir.graph.params import param
from deferred_ir.graph.pass_base import Pass
from deferred_ir.graph.ports import Buffer, Description, Input, Output, Texture
from deferred_ir.rays.direct import trace_direct
from deferred_ir.rays.pixel_surfaces import PixelJob
from deferred_ir.vpls.interleaving import find_places, find_share_starts
from deferred_ir.vpls.ray_masks import BITS, trace_masks


@dataclass(frozen=True)
class Params:
    """Parameters of visibility by rays."""

    visibility: Literal["maps", "rays"] = param(
        "maps", doc="Where VPLs' shadows come from: maps, drawn by OpenGL, or rays, traced on the CPU."
    )
    disc_samples: int = param(
        16,
        lo=1,
        hi=64,
        doc="By rays: points that a pixel traces rays to, of a direct light that has an area.",
    )


class ShadowRays(Pass):
    """Visibility of the VPLs of its share at each pixel, and the light of the direct lights there."""

    Params = Params
    inputs: ClassVar[Mapping[str, Input]] = {
        "vpls": Input("the VPLs in the order of their shares", format="share"),
        "depth": Input("reversed depth", format="depth32f"),
        "normals": Input("shading and geometric normal", format="rgba16"),
    }

    def outputs(self, inputs: Mapping[str, Description | None]) -> Mapping[str, Output]:
        """Return what one spotlight needs."""
        return self.outputs_for(NOTHING_KNOWN, inputs)

    def outputs_for(self, facts: Facts, inputs: Mapping[str, Description | None]) -> Mapping[str, Output]:
        """Return masks, with a layer for each 32 VPLs of a share, and the direct light."""
        vpls = inputs["vpls"]
        assert isinstance(vpls, Buffer)
        layers = max(-(-vpls.records // (vpls.parts * BITS)), 1)
        doc = "bit b of layer w: whether the pixel sees VPL 32 w + b of its share; in sub-buffers"
        return {
            "masks": Output(doc, Texture("r32ui", layers=layers), attach=False),
            "direct": describe_direct(facts[DIRECT_LIGHTS]),
        }

    def unneeded(self, facts: Facts) -> str | None:
        """Leave the pass out where maps are chosen."""
        if not facts[EMITS]:
            return "nothing shines"
        return "visibility is 'maps'" if self.params.visibility == "maps" else None

    def depends(self) -> frozenset[str]:
        """The rays' ends: what the camera sees, and the light; and what lies between."""
        return frozenset({"camera", "light", "models", "seed"})

    def execute(self, frame: Frame, io: Io) -> None:
        """Read the G-buffer back, trace, upload."""
        vpls, parts = io["vpls"].records, io["vpls"].description.parts
        tracer, seen = frame.tracer(), frame.read_surfaces(io["depth"], io["normals"])
        n = round(parts**0.5)
        share, place = find_places(seen.pixel, frame.size, n)
        starts = find_share_starts(len(vpls), n)
        shares = [(np.flatnonzero(share == i), slice(int(starts[i]), int(starts[i + 1]))) for i in range(parts)]
        width, height = frame.size
        image = np.zeros((io["masks"].description.layers, height * width), np.uint32)
        if len(vpls):
            parallel = vpls["tan_half"] == 0
            words, _ = trace_masks(tracer, seen, read_vpls(vpls), read_limits(vpls), shares, parallel=parallel)
            image[: len(words), place] = words
        io["masks"].upload(image.reshape(-1, height, width, 1))
        job = PixelJob(tracer, seen, frame.size, n, frame.seed)
        io["direct"].upload(trace_direct(job, samples=self.params.disc_samples))


PASS = ShadowRays
