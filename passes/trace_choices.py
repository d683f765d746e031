"""Ask by rays which of its choices each sample sees: choices, lists, samples -> one bit a choice.

Samples and choices are read back, Embree traces on the CPU, and the answers go up.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from deferred_ir.frame.frame import Frame
from deferred_ir.frame.pass_io import Io
from deferred_ir.frame.vpl_params import explain_no_vpls
from deferred_ir.graph.facts import Facts
from deferred_ir.graph.figures import Figure
from deferred_ir.graph.pass_base import Pass
from deferred_ir.graph.ports import Description, Input, Output, Texture
from deferred_ir.rays.seen_points import PointsToSee, find_seen

NOBODY = 0xFFFFFFFF
"""A choice of no VPL, as in shaders/lib/pool/list.glsl."""
RAYS = Figure("choice_rays", "Shadow rays to the VPLs that samples have chosen.", ("choice_rays",))


class TraceChoices(Pass):
    """Bits that say which of its choices each sample sees."""

    figures = (RAYS,)
    inputs: ClassVar[Mapping[str, Input]] = {
        "choices": Input("places in the lists", format="rgba32ui"),
        "vpls": Input("the pool", format="vpl"),
        "numbers": Input("numbers in the pool of the VPLs of all lists", format="r32ui"),
        "positions": Input("where samples are", format="rgba32f"),
        "sample_normals": Input("their normals", format="rgba16"),
    }

    def outputs(self, inputs: Mapping[str, Description | None]) -> Mapping[str, Output]:
        """Return one texture of the frame's size."""
        del inputs
        return {"seen": Output("bit k: whether the sample sees choice k", Texture("r32ui"), attach=False)}

    def depends(self) -> frozenset[str]:
        """What lies between samples and VPLs."""
        return frozenset({"models"})

    def unneeded(self, facts: Facts) -> str | None:
        """Leave the pass out where there are no VPLs."""
        return explain_no_vpls(facts)

    def execute(self, frame: Frame, io: Io) -> None:
        """Read back, trace, upload."""
        (width, height), vpls = frame.size, io["vpls"].records
        image = np.zeros(height * width, np.uint32)
        if not len(vpls):
            io["seen"].upload(image.reshape(height, width, 1))
            return
        samples, tracer = frame.read_samples(io["positions"], io["sample_normals"]), frame.tracer()
        places = tracer.lift(vpls["position"], vpls["z_axis"])  # off their surfaces, beside which walls may stand
        choices = np.concatenate(
            [layer.reshape(-1, 4).take(samples.pixel, axis=0) for layer in io["choices"].read()], axis=1
        )
        numbers = io["numbers"].read().reshape(-1)
        points = PointsToSee(places[numbers], vpls["z_axis"][numbers], vpls["tan_half"][numbers] == 0)
        bits, rays = find_seen(tracer, samples, points, choices, NOBODY)
        image[samples.pixel] = bits
        io["seen"].upload(image.reshape(height, width, 1))
        io.count(RAYS.name, rays)


PASS = TraceChoices
