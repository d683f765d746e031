"""Incremental instant radiosity (Laine et al. 2007): -> vpls, with versions that say which of them are new.

A few VPLs are new in each frame, the others stay where they are and keep their tile of the atlas, so that only the new
ones need a map. They end where scene, seed or parameters are others, or the spotlight is turned off.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from deferred_ir.base.errors import GraphError
from deferred_ir.frame.frame import Frame
from deferred_ir.frame.pass_io import Io
from deferred_ir.frame.vpl_buffer import describe_output, pack_vpls
from deferred_ir.frame.vpl_params import VPLS_ALIVE, VplParams
from deferred_ir.graph.facts import Facts, Statements
from deferred_ir.graph.figures import Figure
from deferred_ir.graph.params import param
from deferred_ir.graph.pass_base import Pass
from deferred_ir.graph.ports import Description, Output
from deferred_ir.vpls.cast import NONE
from deferred_ir.vpls.incremental import IncrementalVpls

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
    """The VPLs so far, and the parameters and the seed that they were made with."""

    key: tuple[Params, int] | None = None
    vpls: IncrementalVpls | None = None


class IncrementalVpl(Pass):
    """Keeps the VPLs that the spotlight still reaches, casts a few new ones and packs them for the shaders."""

    Params = Params
    figures = (VPLS_ALIVE, VPLS_WAITING)
    State = State
    retains_samples = True

    def outputs(self, inputs: Mapping[str, Description | None]) -> Mapping[str, Output]:
        """One buffer with room for a VPL for each ray."""
        del inputs
        if self.params.least > self.params.most:
            raise GraphError(f"least {self.params.least}: is more than most, {self.params.most}; give both")
        return {"vpls": describe_output(self.params)}

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
        light, p, state = frame.scene.spotlight, self.params, io.state
        if p.count == 0 or not frame.scene.emits:
            state.vpls = None
            io["vpls"].write(pack_vpls(frame.scene, NONE, p, NONE.ray))
            return
        key = p, frame.seed
        all_vpls = state.vpls if state.vpls and state.key == key else IncrementalVpls(p.count, frame.seed)
        state.vpls = None  # an update that is broken off leaves nothing to go on from
        vpls = all_vpls.update(light, frame.tracer(), least=p.least, most=p.most)
        state.key, state.vpls = key, all_vpls
        if not all_vpls.at_rest:
            io.repeat()
        io["vpls"].write(pack_vpls(frame.scene, vpls, p, vpls.ray), all_vpls.version[vpls.ray])
        io.report(VPLS_ALIVE.name, len(vpls))
        io.report(VPLS_WAITING.name, all_vpls.waiting)


PASS = IncrementalVpl
