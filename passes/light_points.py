"""Choose points that stand for lights which have an area or lie all around: -> points, VPLs of bounce 0."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from deferred_ir.frame.facts import SAMPLED
from deferred_ir.frame.frame import Frame
from deferred_ir.frame.pass_io import Io
from deferred_ir.frame.vpl_buffer import describe_points, pack_points
from deferred_ir.graph.facts import Facts
from deferred_ir.graph.params import param
from deferred_ir.graph.pass_base import Pass
from deferred_ir.graph.ports import Description, Output
from deferred_ir.vpls.sample_lights import sample_lights


@dataclass(frozen=True)
class Params:
    """Parameters of points of lights."""

    samples: int = param(
        64,
        lo=1,
        hi=65536,
        doc="Points that stand for all lights together that have an area or lie all around.",
        formerly="lights.samples",
    )


class LightPoints(Pass):
    """Points of rectangles, discs, spheres, environments and emitting surfaces, dealt to them by flux."""

    Params = Params

    def outputs(self, inputs: Mapping[str, Description | None]) -> Mapping[str, Output]:
        """One buffer."""
        del inputs
        return {"points": describe_points(self.params.samples)}

    def unneeded(self, facts: Facts) -> str | None:
        """Leave the pass out where no light needs points."""
        return None if facts[SAMPLED] else "no light has an area or lies all around"

    def depends(self) -> frozenset[str]:
        """The lights, the models, which may emit, and the seed."""
        return frozenset({"light", "models", "seed"})

    def execute(self, frame: Frame, io: Io) -> None:
        """Choose, pack, upload."""
        scene = frame.scene
        points = sample_lights(scene.sampled_lights, scene.bounds, self.params.samples, frame.seed)
        io["points"].write(pack_points(scene, points))


PASS = LightPoints
