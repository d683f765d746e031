"""Cast a pool of VPLs, of which each pixel chooses a few: -> vpls along a curve, groups of neighbours."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from deferred_ir.base.colour import LUMINANCE
from deferred_ir.frame.frame import Frame
from deferred_ir.frame.pass_io import Io
from deferred_ir.frame.vpl_buffer import bring_near, describe_output, join_vpls, pack_vpls
from deferred_ir.frame.vpl_params import AUTO_CLAMP, VPLS_ALIVE, CastParams
from deferred_ir.graph.facts import Facts, Statements
from deferred_ir.graph.params import param
from deferred_ir.graph.pass_base import Pass
from deferred_ir.graph.ports import Buffer, Description, Input, Output, Texture
from deferred_ir.pool.effort import describe_effort
from deferred_ir.pool.proposals import GROUPS, draw_members, order_along_curve, share_power
from deferred_ir.sampling import streams
from deferred_ir.vpls.cast import NONE, cast

ROW = 256
"""VPLs in a row of the texture, as in shaders/lib/pool/pool.glsl."""
MOST = 1 << 17
"""Rays beyond which a larger pool would cost more than it gains."""


@dataclass(frozen=True)
class Params(CastParams):
    """Parameters of the pool."""

    candidates: int = param(64, lo=1, hi=1024, doc="VPLs in the pool for each of `count`; 131072 at most.")

    @property
    def pool(self) -> int:
        """Rays that leave the lights: `candidates` for each of `count`, but no more than MOST, or `count` itself."""
        return max(min(self.count * self.candidates, MOST), self.count)

    @property
    def clamp_fraction(self) -> float:
        """The clamp distance in diagonals; auto goes by the pool's own number of VPLs."""
        return AUTO_CLAMP / max(self.pool, 1) ** 0.5 if self.clamp == "auto" else self.clamp


class VplPool(Pass):
    """Many VPLs, none with a shadow map."""

    Params = Params
    figures = (VPLS_ALIVE,)
    inputs: ClassVar[Mapping[str, Input]] = {
        "points": Input("points of lights, which are VPLs of bounce 0", format="vpl", optional=True)
    }

    def outputs(self, inputs: Mapping[str, Description | None]) -> Mapping[str, Output]:
        """Return a buffer with room for a VPL per ray and bounce, the same as a texture, and a texture of groups."""
        own = replace(self.params, count=self.params.pool)
        vpls = describe_output(own, self.params.bounces, inputs["points"])
        vpls = replace(vpls, defines={**vpls.defines, "POOL_EDGE": self.params.limits(1.0).cosine})
        which = "one VPL of each group, its power that of the group over the pool's: position, power; normal, clamp^2"
        assert isinstance(vpls.description, Buffer)
        rows = max(-(-vpls.description.records // ROW), 1)
        what = (
            "position, power over the pool's; normal, clamp^2; emission, power of the group up to it over the group's"
        )
        return {
            "vpls": vpls,
            "pool": Output(what, Texture("rgba32f", (3 * ROW, rows)), attach=False),
            "groups": Output(which, Texture("rgba32f", (GROUPS, 2)), attach=False),
            "effort": describe_effort(self.params.count),
        }

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
        """Where the light falls."""
        return frozenset({"light", "models", "seed"})

    def execute(self, frame: Frame, io: Io) -> None:
        """Cast, sort, pack, upload."""
        p = self.params
        vpls = NONE
        if p.count > 0 and frame.scene.emits:
            vpls = cast(frame.scene.emitters, frame.tracer(), p.pool, p.pattern, frame.seed, bounces=p.bounces)
        records = join_vpls(io["points"], pack_vpls(frame.scene, vpls, p, np.zeros(len(vpls), int)))
        records = records[order_along_curve(records["position"], records["z_axis"])]
        io["vpls"].write(records)
        records = bring_near(records, frame.scene.bounds.radius)
        shares, within = share_power(records["emission"] @ LUMINANCE)
        io["pool"].upload(_pack_pool(records, within, io["pool"].size[1]))
        io["groups"].upload(
            _pack_groups(records, shares, draw_members(within, streams.pool_groups(frame.seed).random(len(shares))))
        )
        io.report(VPLS_ALIVE.name, len(vpls))


def _pack_pool(records: np.ndarray, within: np.ndarray, rows: int) -> np.ndarray:
    """Return the texels (rows, 3 * ROW, 4) of VPL records (n,), as shaders/lib/pool/pool.glsl reads them.

    within: (n,), the part of its group's power that each has with those before it.
    """
    texels = np.zeros((rows * ROW, 3, 4), np.float32)
    pool, power = texels[: len(records)], records["emission"] @ LUMINANCE
    for texel, name in enumerate(("position", "z_axis", "emission")):
        pool[:, texel, :3] = records[name]
    pool[:, 0, 3] = power / max(float(power.sum(dtype=float)), np.finfo(float).tiny)
    pool[:, 1, 3], pool[:, 2, 3] = records["clamp_squared"], within
    return texels.reshape(rows, 3 * ROW, 4)


def _pack_groups(records: np.ndarray, shares: np.ndarray, drawn: np.ndarray) -> np.ndarray:
    """Return the texels (2, GROUPS, 4) of one VPL `drawn` (g,) from each group; shares: (g,) of the pool's power."""
    texels, chosen = np.zeros((2, GROUPS, 4), np.float32), records[drawn]
    texels[0, : len(drawn), :3], texels[1, : len(drawn), :3] = chosen["position"], chosen["z_axis"]
    texels[0, : len(drawn), 3], texels[1, : len(drawn), 3] = shares, chosen["clamp_squared"]
    return texels


PASS = VplPool
