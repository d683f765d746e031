"""Say which VPLs each tile of the image should look at, by what they would bring to it: pool, samples -> chances.

A shader scores a VPL of each group of the pool at a few samples of each tile, without shadows. The CPU makes chances of
the scores (deferred_ir/pool/proposals.py).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from deferred_ir.frame.frame import Frame
from deferred_ir.frame.pass_io import Io
from deferred_ir.frame.vpl_params import explain_no_vpls
from deferred_ir.graph.facts import Facts
from deferred_ir.graph.pass_base import Pass
from deferred_ir.graph.ports import Description, Input, Output, Texture
from deferred_ir.pool.proposals import GROUPS, TILES, add_up_chances, count_groups
from deferred_ir.pool.samples import read_layout
from deferred_ir.sampling import streams


class ProposeVpls(Pass):
    """Chances of the groups of the pool in each of TILES x TILES tiles."""

    inputs: ClassVar[Mapping[str, Input]] = {
        "layout": Input("where samples stand", format="layout"),
        "vpls": Input("the pool: how many VPLs, and their cone", format="vpl"),
        "groups": Input("a VPL of each of its groups", format="rgba32f"),
        "positions": Input("where samples are", format="rgba32f"),
        "sample_normals": Input("their normals", format="rgba16"),
    }

    def outputs(self, inputs: Mapping[str, Description | None]) -> Mapping[str, Output]:
        """Return a row for each tile and a column for each group."""
        del inputs
        scores = Texture("rgba32f", (GROUPS // 4, TILES**2))
        before = "the chance of each group and of all before it; 0 in a pool without power"
        return {
            "scores": Output("what groups would bring to each tile, four a texel", scores),
            "chances": Output(before, Texture("r32f", (GROUPS, TILES**2)), attach=False),
        }

    def depends(self) -> frozenset[str]:
        """What samples see, which the camera says, and the seed."""
        return frozenset({"camera", "models", "seed"})

    def unneeded(self, facts: Facts) -> str | None:
        """Leave the pass out where there are no VPLs."""
        return explain_no_vpls(facts)

    def execute(self, frame: Frame, io: Io) -> None:
        """Score, read back, add up, upload."""
        shift = streams.pool_probes(frame.seed).random(2).tolist()
        program = io.program("propose_vpls.frag", defines={"SMOOTH": int(frame.smooth), "TILES": TILES})
        program.set(grid=read_layout(io).grid, shift=shift, area=frame.scene.geometry.diagonal**2)
        program.draw_fullscreen()
        count = count_groups(len(io["vpls"].records))
        power = io["groups"].read()[0, :count, 3]
        chances = np.zeros((TILES**2, GROUPS), np.float32)
        chances[:, :count] = add_up_chances(io["scores"].read().reshape(TILES**2, GROUPS)[:, :count], power)
        io["chances"].upload(chances[..., None])


PASS = ProposeVpls
