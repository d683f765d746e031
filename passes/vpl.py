"""Cast VPLs (Keller 1997) on the CPU: -> vpls, a record for each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from deferred_ir.frame.frame import Frame
from deferred_ir.frame.light_culling import LIGHTS_DROPPED
from deferred_ir.frame.pass_io import Io
from deferred_ir.frame.vpl_buffer import MapVersions, describe_output, join_vpls, pack_vpls
from deferred_ir.frame.vpl_params import VPLS_ALIVE, CastParams
from deferred_ir.graph.facts import Facts, Statements
from deferred_ir.graph.params import param
from deferred_ir.graph.pass_base import Pass
from deferred_ir.graph.ports import Description, Input, Output
from deferred_ir.sampling.patterns import warn_unbalanced
from deferred_ir.vpls.cast import NONE, Vpls, cast
from deferred_ir.vpls.resampling import estimate_effects, find_probes, resample


@dataclass(frozen=True)
class Params(CastParams):
    """Parameters of VPLs that are cast anew in each frame."""

    candidates: int = param(
        1,
        lo=1,
        hi=64,
        doc="Candidates for each VPL, one of which is chosen by its contribution to the image. 1: use all.",
    )


class Vpl(Pass):
    """Traces `count` rays from the lights, or more to choose from, and packs the VPLs for the shaders."""

    Params = Params
    figures = (VPLS_ALIVE, LIGHTS_DROPPED)
    State = MapVersions
    inputs: ClassVar[Mapping[str, Input]] = {
        "points": Input("points of lights, which are VPLs of bounce 0", format="vpl", optional=True)
    }

    def __init__(self, params: Any = None) -> None:
        super().__init__(params)
        warn_unbalanced(self.params.pattern, self.params.count)

    def outputs(self, inputs: Mapping[str, Description | None]) -> Mapping[str, Output]:
        """One buffer with room for the points of lights, and for a VPL per ray and bounce."""
        return {"vpls": describe_output(self.params, self.params.bounces, inputs["points"])}

    def state_facts(self, facts: Facts) -> Statements:
        """State whether there may be VPLs, and whether they are clamped."""
        stated: Statements = self.params.state_facts(facts)
        return stated

    def explain_shared_error(self, facts: Facts, inputs: Mapping[str, Description | None]) -> str | None:
        """Return how VPLs lose light."""
        del inputs
        lost: str | None = self.params.explain_lost_light(facts)
        return lost

    def depends(self) -> frozenset[str]:
        """Where the light falls, and for a choice among candidates what the camera sees."""
        return frozenset({"light", "models", "seed"} | ({"camera"} if self.params.candidates > 1 else set()))

    def execute(self, frame: Frame, io: Io) -> None:
        """Cast, pack, upload."""
        p = self.params
        vpls = self._cast(frame) if p.count > 0 and frame.scene.emits else NONE
        records = join_vpls(io["points"], pack_vpls(frame.scene, vpls, p, np.arange(len(vpls))))
        if frame.by_view and len(records):
            reaches = frame.seen_clusters.find_reaching(records)
            records["emission"][~reaches] = 0
            io.count(LIGHTS_DROPPED.name, int((~reaches).sum()))
        io["vpls"].write(records, io.state.update(records, frame.scene) if frame.reuse else None)
        io.report(VPLS_ALIVE.name, len(vpls))

    def _cast(self, frame: Frame) -> Vpls:
        """The VPLs of a frame; with candidates, `count` of them, or more where further bounces bring more."""
        p, tracer, seed = self.params, frame.tracer(), frame.seed
        vpls = cast(frame.scene.emitters, tracer, p.count * p.candidates, p.pattern, seed, bounces=p.bounces)
        count = max(p.count, -(-len(vpls) // p.candidates))
        if len(vpls) <= count:
            return vpls
        seen = find_probes(tracer, frame.scene.camera, frame.size, seed)
        effect = estimate_effects(tracer, seen, vpls, p.limits(frame.scene.geometry.diagonal))
        return resample(vpls, effect, count, seed)


PASS = Vpl
