"""Ask by rays how the direct lights light each pixel: lights, G-buffer -> direct.

A shader says how strongly a light without area would light each pixel and where its ray starts; these are read back,
Embree traces on the CPU, and the answers go up. Rays to others start from the G-buffer, read back. No light needs a
map.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from deferred_ir.base.arrays import Array
from deferred_ir.frame.costs import estimate_direct_map_cost, estimate_direct_ray_cost
from deferred_ir.frame.direct_lights import LIGHTS_PER_BLOCK, describe_direct
from deferred_ir.frame.facts import DIRECT_LIGHTS, EMITS, PIXELS, SOFT, SOFTWARE, TRIANGLES, VIEWS
from deferred_ir.frame.frame import Frame
from deferred_ir.frame.light_culling import find_shining
from deferred_ir.frame.pass_io import Io
from deferred_ir.graph.facts import NOTHING_KNOWN, Facts
from deferred_ir.graph.figures import Figure
from deferred_ir.graph.params import param
from deferred_ir.graph.pass_base import Pass
from deferred_ir.graph.ports import Description, Input, Output, Texture
from deferred_ir.rays.direct import DirectSum, trace_light
from deferred_ir.rays.pixel_surfaces import PixelJob
from deferred_ir.rays.tracer import OFFSET
from deferred_ir.sampling import streams
from deferred_ir.scene.lights.base import DirectLight, end_outside
from deferred_ir.shadows import shader_variants
from deferred_ir.shadows.settings import SPOT_MAP

RAYS = Figure("direct_rays", "Shadow rays to direct lights without area.", ("direct_rays",))


@dataclass(frozen=True)
class Params:
    """Parameters of direct light by rays."""

    visibility: Literal["auto", "maps", "rays"] = param(
        "auto",
        doc="Whether shadows of direct lights come from their maps, where the graph draws these, or from rays; auto: "
        "from whichever should take less time.",
    )
    disc_samples: int = param(
        16, lo=1, hi=64, doc="Points that a pixel traces rays to, of a direct light that has an area."
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
        """Return what one spotlight needs."""
        return self.outputs_for(NOTHING_KNOWN, inputs)

    def outputs_for(self, facts: Facts, inputs: Mapping[str, Description | None]) -> Mapping[str, Output]:
        """Return two textures of the frame's size."""
        del inputs
        starts = "where rays start, off the surface; alpha: irradiance over emission, without shadows"
        return {
            "direct": describe_direct(facts[DIRECT_LIGHTS]),
            "starts": Output(starts, Texture("rgba32f"), transient=True),
        }

    def unneeded(self, facts: Facts) -> str | None:
        """Leave the pass out where the light is off, or where a map is chosen or should take less time."""
        if not facts[EMITS]:
            return "nothing shines"
        if facts[DIRECT_LIGHTS] == 0:
            return "there is no direct light"
        if self.params.visibility == "rays" or not facts[SPOT_MAP]:
            return None
        if self.params.visibility == "maps":
            return "visibility is 'maps'"
        rays = facts[DIRECT_LIGHTS] * estimate_direct_ray_cost(
            facts[PIXELS], self.params.disc_samples if facts[SOFT] else 1
        )
        drawn = len(facts[VIEWS]) * estimate_direct_map_cost(facts[TRIANGLES], software=facts[SOFTWARE])
        return f"the lights' maps should take less time: {drawn:.2g} ms, rays {rays:.2g}" if drawn < rays else None

    def depends(self) -> frozenset[str]:
        """The rays' ends, and what lies between."""
        return frozenset({"camera", "light", "models", "seed"})

    def execute(self, frame: Frame, io: Io) -> None:
        """Find where rays start, read back, trace, upload."""
        (width, height), lights = frame.size, frame.scene.direct_lights
        total = DirectSum(len(lights), width * height)
        for number in np.flatnonzero(find_shining(io["lights"].records)).tolist():
            light, seed = lights[number], streams.frame_seed(frame.seed, number)
            if light.has_area:
                seen = frame.read_surfaces(io["depth"], io["normals"])
                job = PixelJob(frame.tracer(), seen, frame.size, 1, seed)
                total.add(light, trace_light(job, light, samples=self.params.disc_samples))
            else:
                total.add(light, self._trace_point(frame, io, light, number))
        io["direct"].upload(total.image.reshape(height, width, -1))

    def _trace_point(self, frame: Frame, io: Io, light: DirectLight, number: int) -> Array:
        """Return the irradiance over emission of a light without area, float32 (pixels,)."""
        tracer, (block, own) = frame.tracer(), divmod(number, LIGHTS_PER_BLOCK)
        io["lights"].bind(block)
        defines = shader_variants.choose_for_lights(frame, io["lights"].records, None)
        program = io.program("direct_rays.frag", defines=defines | {"SMOOTH": int(frame.smooth)})
        program.set(number=own, offset=tracer.offset, relative_offset=OFFSET)
        program.draw_fullscreen()
        starts = io["starts"].read().reshape(-1, 4)
        strength: Array = starts[:, 3].copy()
        lit = np.flatnonzero(strength)
        at = starts.take(lit, axis=0)[:, :3]
        place = light.describe().get("position")
        if place is None:  # it lies at infinity
            ends = end_outside(at, np.asarray(-light.describe()["axis"], np.float32), frame.scene.bounds)
        else:
            ends = np.broadcast_to(np.asarray(place, np.float32), at.shape)
        strength[lit[tracer.occluded(at, ends)]] = 0
        io.count(RAYS.name, len(lit))
        return strength


PASS = DirectRays
