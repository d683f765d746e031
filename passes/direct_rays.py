"""Ask by rays how the spotlight lights each pixel: lights, G-buffer -> spotlight.

A shader says how strongly a point light would light each pixel and where its ray starts; these are read back, Embree
traces on the CPU, and the answers go up. Rays to a disc start from the G-buffer, read back. The light needs no map.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from deferred_ir.frame.costs import estimate_direct_map_cost, estimate_direct_ray_cost
from deferred_ir.frame.facts import EMITS, PIXELS, SOFT, SOFTWARE, TRIANGLES
from deferred_ir.frame.frame import Frame
from deferred_ir.frame.pass_io import Io
from deferred_ir.graph.facts import Facts
from deferred_ir.graph.figures import Figure
from deferred_ir.graph.params import param
from deferred_ir.graph.pass_base import Pass
from deferred_ir.graph.ports import Description, Input, Output, Texture
from deferred_ir.rays.direct import trace_spotlight
from deferred_ir.rays.pixel_surfaces import PixelJob
from deferred_ir.rays.tracer import OFFSET
from deferred_ir.shadows.settings import SPOT_MAP

RAYS = Figure("direct_rays", "Shadow rays to a point light.", ("direct_rays",))


@dataclass(frozen=True)
class Params:
    """Parameters of direct light by rays."""

    visibility: Literal["auto", "maps", "rays"] = param(
        "auto",
        doc="Whether the spotlight's shadow comes from its map, where the graph draws one, or from rays; auto: from "
        "whichever should take less time.",
    )
    disc_samples: int = param(
        16, lo=1, hi=64, doc="Points of the spotlight's disc that a pixel traces rays to, where it has a radius."
    )


class DirectRays(Pass):
    """Direct light with exact shadows."""

    Params = Params
    figures = (RAYS,)
    inputs: ClassVar[Mapping[str, Input]] = {
        "lights": Input("the direct lights", format="light"),
        "depth": Input("reversed depth", format="depth32f"),
        "normals": Input("shading and geometric normal", format="rgba16"),
    }

    def outputs(self, inputs: Mapping[str, Description | None]) -> Mapping[str, Output]:
        """Return two textures of the frame's size."""
        del inputs
        doc = "irradiance from the spotlight over its emission, shadows included; 0 on the background"
        starts = "where rays start, off the surface; alpha: irradiance over emission, without shadows"
        return {
            "spotlight": Output(doc, Texture("r32f"), attach=False),
            "starts": Output(starts, Texture("rgba32f"), transient=True),
        }

    def unneeded(self, facts: Facts) -> str | None:
        """Leave the pass out where the light is off, or where a map is chosen or should take less time."""
        if not facts[EMITS]:
            return "the spotlight emits nothing"
        if self.params.visibility == "rays" or not facts[SPOT_MAP]:
            return None
        if self.params.visibility == "maps":
            return "visibility is 'maps'"
        rays = estimate_direct_ray_cost(facts[PIXELS], self.params.disc_samples if facts[SOFT] else 1)
        drawn = estimate_direct_map_cost(facts[TRIANGLES], software=facts[SOFTWARE])
        return f"the spotlight's map should take less time: {drawn:.2g} ms, rays {rays:.2g}" if drawn < rays else None

    def depends(self) -> frozenset[str]:
        """The rays' ends, and what lies between."""
        return frozenset({"camera", "light", "models", "seed"})

    def execute(self, frame: Frame, io: Io) -> None:
        """Find where rays start, read back, trace, upload."""
        tracer, light, (width, height) = frame.tracer(), frame.scene.spotlight, frame.size
        if light.has_area:
            seen = frame.read_surfaces(io["depth"], io["normals"])
            image = trace_spotlight(PixelJob(tracer, seen, frame.size, 1, frame.seed), samples=self.params.disc_samples)
        else:
            io["lights"].bind()
            program = io.program("direct_rays.frag", defines={"SMOOTH": int(frame.smooth)})
            program.set(offset=tracer.offset, relative_offset=OFFSET)
            program.draw_fullscreen()
            starts = io["starts"].read().reshape(-1, 4)
            image = starts[:, 3].copy()
            lit = np.flatnonzero(image)
            places = np.broadcast_to(np.asarray(light.position, np.float32), (len(lit), 3))
            image[lit[tracer.occluded(starts.take(lit, axis=0)[:, :3], places)]] = 0
            io.count(RAYS.name, len(lit))
        io["spotlight"].upload(image.reshape(height, width, 1))


PASS = DirectRays
