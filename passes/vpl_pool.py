"""Cast a pool of VPLs, of which each pixel chooses a few: -> vpls along a curve, groups of neighbours."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from deferred_ir.base.colour import LUMINANCE
from deferred_ir.frame.frame import Frame
from deferred_ir.frame.pass_io import Io
from deferred_ir.frame.vpl_buffer import describe_output, pack_vpls
from deferred_ir.frame.vpl_params import AUTO_CLAMP, VPLS_ALIVE, CastParams
from deferred_ir.graph.facts import Facts, Statements
from deferred_ir.graph.params import param
from deferred_ir.graph.pass_base import Pass
from deferred_ir.graph.ports import Description, Output, Texture
from deferred_ir.pool.proposals import GROUPS, Groups, order_along_curve
from deferred_ir.sampling import streams
from deferred_ir.vpls.cast import NONE, cast

MOST = 1 << 17
"""Rays beyond which a larger pool would cost more than it gains."""


@dataclass(frozen=True)
class Params(CastParams):
    """Parameters of the pool."""

    candidates: int = param(64, lo=1, hi=1024, doc="VPLs in the pool for each of `count`; 131072 at most.")

    @property
    def pool(self) -> int:
        """Rays that leave the spotlight: `candidates` for each of `count`, but no more than MOST, or `count` itself."""
        return max(min(self.count * self.candidates, MOST), self.count)

    @property
    def clamp_fraction(self) -> float:
        """The clamp distance in diagonals; auto goes by the pool's own number of VPLs."""
        return AUTO_CLAMP / max(self.pool, 1) ** 0.5 if self.clamp == "auto" else self.clamp


class VplPool(Pass):
    """Many VPLs, none with a shadow map."""

    Params = Params
    figures = (VPLS_ALIVE,)

    def outputs(self, inputs: Mapping[str, Description | None]) -> Mapping[str, Output]:
        """Return a buffer with room for a VPL per ray and bounce, and a texture of groups."""
        del inputs
        vpls = describe_output(replace(self.params, count=self.params.pool), self.params.bounces)
        vpls = replace(vpls, defines={**vpls.defines, "POOL_EDGE": self.params.limits(1.0).cosine})
        which = "one VPL of each group, its power that of the group over the pool's: position, power; normal, clamp^2"
        return {"vpls": vpls, "groups": Output(which, Texture("rgba32f", (GROUPS, 2)), attach=False)}

    def state_facts(self, facts: Facts) -> Statements:
        """State whether there may be VPLs, and whether they are clamped."""
        stated: Statements = self.params.state_facts(facts)
        return stated

    def depends(self) -> frozenset[str]:
        """Where the light falls."""
        return frozenset({"light", "models", "seed"})

    def execute(self, frame: Frame, io: Io) -> None:
        """Cast, sort, pack, upload."""
        p = self.params
        vpls = NONE
        if p.count > 0 and frame.scene.emits:
            vpls = cast(frame.scene.spotlight, frame.tracer(), p.pool, p.pattern, frame.seed, bounces=p.bounces)
        records = pack_vpls(frame.scene, vpls, p, np.zeros(len(vpls), int))
        records = records[order_along_curve(records["position"], records["z_axis"])]
        io["vpls"].write(records)
        io["groups"].upload(_pack_groups(records, frame.seed))
        io.report(VPLS_ALIVE.name, len(vpls))


def _pack_groups(records: np.ndarray, seed: int) -> np.ndarray:
    """Return the texels (2, GROUPS, 4) of a VPL drawn by power from each group of VPL records (n,)."""
    texels = np.zeros((2, GROUPS, 4), np.float32)
    groups = Groups.of_power(records["emission"] @ LUMINANCE)
    power = groups.power
    if power.sum() > 0:
        number = np.arange(len(power))
        member, _ = groups.draw_members(number, streams.pool_groups(seed).random(len(power)))
        drawn = records[member]
        texels[0, number, :3], texels[1, number, :3] = drawn["position"], drawn["z_axis"]
        texels[0, number, 3], texels[1, number, 3] = power / power.sum(), drawn["clamp_squared"]
    return texels


PASS = VplPool
