"""Deal the VPLs to the pixels of a block (Keller and Heidrich 2001): vpls -> dealt, in the order of their shares."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from deferred_ir.base.errors import GraphError
from deferred_ir.frame.frame import Frame
from deferred_ir.frame.light_culling import put_shining_first
from deferred_ir.frame.pass_io import Io
from deferred_ir.frame.vpl_buffer import DEFINES, VplsMeta
from deferred_ir.frame.vpl_params import SHARES
from deferred_ir.graph.facts import Facts, Statements
from deferred_ir.graph.params import param
from deferred_ir.graph.pass_base import Pass
from deferred_ir.graph.ports import Buffer, Description, Input, Output
from deferred_ir.vpls.interleaving import SharesMeta, deal, find_share_starts

BLOCK = np.dtype("i4")


@dataclass(frozen=True)
class Params:
    """Parameters of interleaved sampling."""

    n: int = param(4, lo=1, hi=8, doc="Edge of a block, 1, 2, 4 or 8 pixels; each pixel gets 1/n^2 of the VPLs.")


class Interleave(Pass):
    """The VPLs, sorted by share."""

    Params = Params
    inputs: ClassVar[Mapping[str, Input]] = {"vpls": Input("the VPLs", format="vpl")}

    def outputs(self, inputs: Mapping[str, Description | None]) -> Mapping[str, Output]:
        """Return the sorted VPLs, and the edge of a block by itself, for passes that do not depend on the VPLs."""
        vpls, n = inputs["vpls"], self.params.n
        assert isinstance(vpls, Buffer)
        if n & (n - 1):
            raise GraphError(f"n {n}: wants 1, 2, 4 or 8")
        dealt = replace(vpls, format="share", parts=n * n)
        edge = {"INTERLEAVE": n}
        block = Buffer("block", 1, BLOCK.itemsize, parts=n * n)
        return {
            "dealt": Output("the VPLs in the order of their shares", dealt, {**DEFINES, **edge}, meta=SharesMeta(n)),
            "block": Output("edge of a block of pixels: how the VPLs are dealt", block, edge, meta=SharesMeta(n)),
        }

    def state_facts(self, facts: Facts) -> Statements:
        """State the number of shares."""
        del facts
        return {SHARES: self.params.n**2}

    def unneeded(self, facts: Facts) -> str | None:
        """Leave the pass out where there is only one share."""
        del facts
        return "n is 1: every pixel is lit by all VPLs" if self.params.n == 1 else None

    def depends(self) -> frozenset[str]:
        """Nothing of the frame."""
        return frozenset()

    def execute(self, frame: Frame, io: Io) -> None:
        """Shuffle and upload the VPLs, those without power last in each run of VPLs that one draw adds up."""
        del frame
        vpls, capacity = io["vpls"].records, io["vpls"].description
        points = io.meta("vpls", VplsMeta).points
        order = deal(vpls["tile"].astype(int), capacity.records, points)
        parts = np.union1d(find_share_starts(len(vpls), self.params.n), np.arange(0, len(vpls), capacity.block))
        io["dealt"].write(put_shining_first(vpls[order], parts))
        io["block"].write(np.array([self.params.n], BLOCK))


PASS = Interleave
