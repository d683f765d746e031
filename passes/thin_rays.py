"""Light by all VPLs, with shadow rays, the pixels for which `gather` found too few neighbours: thin -> irradiance.

Where VPLs have no maps. The list is read back, and the reference's own sum is made for its pixels on the CPU.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import acos, degrees, sqrt
from typing import ClassVar

import numpy as np

from deferred_ir import vpl_reference
from deferred_ir.frame import Frame
from deferred_ir.graph import Description, Input, Output, Pass, Texture
from deferred_ir.io import Io
from deferred_ir.surfaces import from_gbuffer
from deferred_ir.tracing import Hits
from deferred_ir.vpls import Vpls


class ThinRays(Pass):
    """Irradiance from all VPLs at the pixels of a list."""

    inputs: ClassVar[Mapping[str, Input]] = {
        "vpls": Input("the VPLs", format="share"),
        "rays": Input("which VPLs are seen: connected where they have no maps", format="r32ui"),
        "thin": Input("numbers of the pixels", format="r32ui"),
        "count": Input("how many", format="r32ui"),
        "depth": Input("reversed depth", format="depth32f"),
        "normals": Input("shading and geometric normal", format="rgba16"),
    }

    def outputs(self, inputs: Mapping[str, Description | None]) -> Mapping[str, Output]:
        """A texture of the frame's size."""
        del inputs
        return {"irradiance": Output("irradiance at these pixels; 0 at all others", Texture("rgba32f"), attach=False)}

    def execute(self, frame: Frame, io: Io) -> None:
        """Read back, trace, upload."""
        width, height = frame.size
        vpls, scene, tracer = io["vpls"].records, frame.scene, frame.tracer()
        image = np.zeros((height * width, 4), np.float32)
        chosen = np.zeros(height * width, bool)
        chosen[io["thin"].read().reshape(-1)[: int(io["count"].read()[0, 0, 0])]] = True
        depth = io["depth"].read()[..., 0] * chosen.reshape(height, width)
        seen = from_gbuffer(scene.camera, frame.near, depth, io["normals"].read())
        if len(vpls) and len(seen.pixel):
            white = np.full((len(seen.pixel), 3), np.pi)  # reflected radiance is then the irradiance
            hits = Hits(np.zeros(len(white), int), seen.position, seen.normal, seen.shading_normal, white)
            lights = Vpls(vpls["position"], vpls["z_axis"], vpls["emission"].astype(float), np.arange(len(vpls)))
            fov = 2 * degrees(acos(1 - float(vpls["one_minus_cos"][0])))
            clamp = sqrt(vpls["clamp_squared"][0]) / scene.geometry.diagonal
            image[seen.pixel, :3] = vpl_reference.indirect(tracer, hits, lights, fov=fov, clamp=clamp)
        io["irradiance"].upload(image.reshape(height, width, 4))


PASS = ThinRays
