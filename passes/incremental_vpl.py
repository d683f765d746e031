"""Incremental instant radiosity (Laine et al. 2007): -> vpls, with versions that say which of them are new.

A few VPLs are new in each frame, the others stay where they are and keep their tile of the atlas, so that only the new
ones need a map. They end where scene, seed or parameters are others, or nothing shines. That is for spotlights and
points. VPLs of other kinds of lights, and the points that stand for lights, are made anew in each frame; while their
light stays they come out the same, and their maps are kept.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from deferred_ir.base.arrays import Bools, Ints
from deferred_ir.base.errors import GraphError
from deferred_ir.frame.frame import Frame
from deferred_ir.frame.pass_io import Io
from deferred_ir.frame.vpl_buffer import MapVersions, describe_output, join_vpls, pack_vpls
from deferred_ir.frame.vpl_params import VPLS_ALIVE, VplParams
from deferred_ir.graph.facts import Facts, Statements
from deferred_ir.graph.figures import Figure
from deferred_ir.graph.params import param
from deferred_ir.graph.pass_base import Pass
from deferred_ir.graph.ports import Description, Input, Output
from deferred_ir.vpls.cast import NONE
from deferred_ir.vpls.kept_lights import FrameVpls, KeptVpls

VPLS_WAITING = Figure("vpls_waiting", "Rays for VPLs that no frame has cast yet.")


@dataclass(frozen=True)
class Params(VplParams):
    """Parameters of VPLs that outlive their frame."""

    least: int = param(
        2, lo=0, hi=65536, doc="VPLs that a frame may replace to improve their distribution; at most `most`."
    )
    most: int = param(
        8, lo=0, hi=65536, doc="Limit on the new VPLs in a frame, and so on the maps of VPLs that it draws."
    )


@dataclass
class State:
    """The VPLs so far, and the parameters and the seed that they were made with.

    others: versions of the maps of points of lights, and of VPLs that are cast anew.
    """

    key: tuple[Params, int] | None = None
    vpls: KeptVpls | None = None
    others: MapVersions = field(default_factory=MapVersions)


class IncrementalVpl(Pass):
    """Keeps the VPLs that their lights still reach, casts a few new ones and packs them for the shaders."""

    Params = Params
    figures = (VPLS_ALIVE, VPLS_WAITING)
    State = State
    retains_samples = True
    inputs: ClassVar[Mapping[str, Input]] = {
        "points": Input("points of lights, which are VPLs of bounce 0", format="vpl", optional=True)
    }

    def outputs(self, inputs: Mapping[str, Description | None]) -> Mapping[str, Output]:
        """One buffer with room for a VPL for each ray."""
        if self.params.least > self.params.most:
            raise GraphError(f"least {self.params.least}: is more than most, {self.params.most}; give both")
        return {"vpls": describe_output(self.params, points=inputs["points"])}

    def state_facts(self, facts: Facts) -> Statements:
        """State whether there may be VPLs, and whether they are clamped."""
        stated: Statements = self.params.state_facts(facts)
        return stated

    def explain_shared_error(self, facts: Facts, inputs: Mapping[str, Description | None]) -> str | None:
        """Return how VPLs lose light."""
        del inputs
        lost: str | None = self.params.explain_lost_light(facts)
        return lost

    def frames_to_fill(self) -> int:
        """As many VPLs as there may be new ones in each."""
        count, most = int(self.params.count), int(self.params.most)
        return max(1, -(-count // max(most, 1)))

    def explain_unfilled(self, name: str, figures: Mapping[str, int], averaged: int) -> str | None:
        """Say how many VPLs there are so far, where the budget of a frame is less than all of them."""
        count, frames, waiting = self.params.count, self.frames_to_fill(), figures.get(VPLS_WAITING.name, 0)
        if averaged > 1:
            few = f"each of the {averaged} frames that are averaged starts afresh, with few of {count} VPLs"
            return f"{few}; --set {name}.most={count} gives them all" if frames > 1 else None
        so_far = f"{count - waiting} of {count} rays for VPLs so far"
        mend = f"{frames} frames fill the set where nothing moves, or --set {name}.most={count}"
        return f"{so_far}: {mend}" if waiting else None

    def depends(self) -> frozenset[str]:
        """Where the light falls."""
        return frozenset({"light", "models", "seed"})

    def execute(self, frame: Frame, io: Io) -> None:
        """Go on from what the last frame left, pack, upload."""
        p, state = self.params, io.state
        if p.count == 0 or not frame.scene.emits:
            state.vpls, found = None, FrameVpls(NONE, NONE.ray, NONE.ray > 0)
        else:
            key = p, frame.seed
            all_vpls = state.vpls if state.vpls and state.key == key else KeptVpls(p.count, frame.seed)
            state.vpls = None  # an update that is broken off leaves nothing to go on from
            found = all_vpls.update(frame.scene.emitters, frame.tracer(), least=p.least, most=p.most)
            state.key, state.vpls = key, all_vpls
            if not all_vpls.at_rest:
                io.repeat()
            io.report(VPLS_ALIVE.name, len(found.vpls))
            io.report(VPLS_WAITING.name, all_vpls.waiting)
        records = join_vpls(io["points"], pack_vpls(frame.scene, found.vpls, p, found.vpls.ray))
        kept: Bools = np.concatenate([np.zeros(len(records) - len(found.kept), bool), found.kept])
        versions: Ints = np.zeros(len(records), np.int64)
        versions[kept] = found.versions[found.kept]
        versions[~kept] = state.others.update(records[~kept], frame.scene)
        io["vpls"].write(records, versions)


PASS = IncrementalVpl
