"""Light lonely pixels by the VPLs that they miss, with shadow rays: lonely pixels, vpls, G-buffer -> irradiance.

Runs where VPLs have no maps. The list is read back, and its pixels are lit on the CPU as in a reference by VPLs.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import closing
from typing import ClassVar

import numpy as np

from deferred_ir.base.arrays import Array, Ints
from deferred_ir.base.parallel import run_in_order
from deferred_ir.frame.frame import Frame
from deferred_ir.frame.pass_io import Io
from deferred_ir.frame.vpl_buffer import read_limits, read_vpls
from deferred_ir.graph.pass_base import Pass
from deferred_ir.graph.ports import Description, Input, Output, Texture
from deferred_ir.rays.pixel_surfaces import Surfaces
from deferred_ir.rays.tracer import Hits, Tracer
from deferred_ir.vpls.interleaving import find_share_starts, sort_lonely_list
from deferred_ir.vpls.ray_sum import ScaledSurfaces, ScaledVpls


class LightLonelyPixels(Pass):
    """Irradiance of lonely pixels from the VPLs of the shares that they miss."""

    inputs: ClassVar[Mapping[str, Input]] = {
        "vpls": Input("the VPLs", format="share"),
        "rays": Input("which VPLs are seen: connected where they have no maps", format="r32ui"),
        "lonely_pixels": Input("numbers of the pixels with too few neighbours", format="r32ui"),
        "missing": Input("bits of the shares that each of them lacks", format="rg32ui"),
        "lonely_count": Input("how many there are", format="r32ui"),
        "depth": Input("reversed depth", format="depth32f"),
        "normals": Input("shading and geometric normal", format="rgba16"),
    }

    def outputs(self, inputs: Mapping[str, Description | None]) -> Mapping[str, Output]:
        """Return one texture of the frame's size."""
        del inputs
        return {
            "irradiance": Output(
                "irradiance at these pixels; 0 at all others", Texture("rgba32f"), attach=False, transient=True
            )
        }

    def depends(self) -> frozenset[str]:
        """What the camera sees, and what lies between it and the VPLs."""
        return frozenset({"camera", "models"})

    def execute(self, frame: Frame, io: Io) -> None:
        """Read the list and the G-buffer back, trace, upload."""
        width, height = frame.size
        vpls, parts = io["vpls"].records, io["vpls"].description.parts
        count = int(io["lonely_count"].read()[0, 0, 0])
        bits = np.zeros((height * width, 2), np.uint32)
        listed = sort_lonely_list(io["lonely_pixels"].read())[:count, 0]
        bits[listed] = sort_lonely_list(io["missing"].read())[:count]
        seen = frame.read_surfaces(io["depth"], io["normals"])
        asking = seen.rows(np.flatnonzero(bits[seen.pixel].any(axis=1)))
        image = np.zeros((height * width, 4), np.float32)
        if len(vpls) and len(asking.pixel):
            image[asking.pixel, :3] = _sum_irradiance(frame.tracer(), asking, vpls, bits[asking.pixel], parts)
        io["irradiance"].upload(image.reshape(height, width, 4))


def _sum_irradiance(tracer: Tracer, seen: Surfaces, vpls: np.ndarray, bits: Ints, parts: int) -> Array:
    """Return irradiance (n, 3) of `seen` from those of `parts` shares of the VPLs that have a bit in `bits` (n, 2)."""
    geometry = tracer.scene.geometry
    scaled = ScaledVpls.from_vpls(tracer, read_vpls(vpls), read_limits(vpls))
    starts = find_share_starts(len(vpls), round(parts**0.5)).tolist()
    hits = Hits(np.zeros(len(bits), int), seen.position, seen.normal, seen.shading_normal, np.ones((len(bits), 3)))
    rows = [np.flatnonzero(bits[:, share // 32] >> np.uint32(share % 32) & 1) for share in range(parts)]
    tasks = [share for share in range(parts) if len(rows[share]) and starts[share] < starts[share + 1]]

    def work(share: int) -> Array:
        surfaces = ScaledSurfaces(tracer, hits.rows(rows[share]))
        return surfaces.sum_irradiance(scaled, slice(starts[share], starts[share + 1]))

    total = np.zeros((len(bits), 3))
    with closing(run_in_order(work, tasks)) as results:
        for share, part in zip(tasks, results, strict=True):
            total[rows[share]] += part.T
    irradiance: Array = total / geometry.scale**2
    return irradiance


PASS = LightLonelyPixels
