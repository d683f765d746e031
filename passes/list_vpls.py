"""Draw a list of VPLs for each tile of the image: pool, chances -> lists, and the VPLs' numbers in the pool."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from deferred_ir.frame.frame import Frame
from deferred_ir.frame.pass_io import Io
from deferred_ir.frame.vpl_params import explain_no_vpls
from deferred_ir.graph.facts import Facts
from deferred_ir.graph.params import param
from deferred_ir.graph.pass_base import Pass
from deferred_ir.graph.ports import Description, Input, Output, Texture
from deferred_ir.graph.stages import Stage, stage_param
from deferred_ir.pool.effort import accept_effort, read_effort
from deferred_ir.pool.proposals import TILES, count_groups


@dataclass(frozen=True)
class Params:
    """Parameters of the lists."""

    entries: int = param(512, lo=16, hi=4096, doc="VPLs in the list of a tile.", formerly="propose_vpls.entries")
    stage: Stage = stage_param()


class ListVpls(Pass):
    """A list of VPLs for each tile, with weights that make the sum over a list right in the mean at every pixel."""

    Params = Params
    inputs: ClassVar[Mapping[str, Input]] = {
        "vpls": Input("the VPLs of the pool", format="vpl"),
        "pool": Input("the same as a texture", format="rgba32f"),
        "chances": Input("of each group and all before it, a row for each tile", format="r32f"),
        "effort": accept_effort("factor on `entries`"),
    }

    def outputs(self, inputs: Mapping[str, Description | None]) -> Mapping[str, Output]:
        """Return textures with a row for each tile and a column for each entry."""
        entries = self.params.entries * read_effort(inputs)
        size, defines = (entries, TILES**2), {"LIST_ENTRIES": entries, "TILES": TILES}
        return {
            "numbers": Output("numbers of the VPLs in the pool", Texture("r32ui", size), image=True),
            "list_positions": Output(
                "position, luminous power over the pool's times weight", Texture("rgba32f", size), defines, image=True
            ),
            "list_normals": Output("normal, clamp^2", Texture("rgba32f", size), image=True),
            "list_emissions": Output("emission times weight", Texture("rgba32f", size), image=True),
        }

    def depends(self) -> frozenset[str]:
        """The seed."""
        return frozenset({"seed"})

    def unneeded(self, facts: Facts) -> str | None:
        """Leave the pass out where there are no VPLs."""
        return explain_no_vpls(facts)

    def execute(self, frame: Frame, io: Io) -> None:
        """Draw all lists."""
        count = len(io["vpls"].records)
        program = io.stage_program("list_vpls/list")
        program.set(vpls=count, groups=count_groups(count), frame_seed=frame.seed & 0x7FFFFFFF)
        io.cover(program, [(0, 0, *io["numbers"].size)])


PASS = ListVpls
