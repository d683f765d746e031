"""Let each sample choose a few VPLs from its tile's list: lists, samples -> choices and their weights.

Resampled importance sampling (Talbot et al. 2005): of `draws` VPLs of the list a sample keeps `rays`, each with a
probability in proportion to what it would bring unshadowed, and a weight that makes the mean right. Neighbouring
samples draw other VPLs and keep others, so their errors differ, and a filter can take them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from deferred_ir.base.errors import GraphError
from deferred_ir.frame.frame import Frame
from deferred_ir.frame.pass_io import Io
from deferred_ir.frame.vpl_params import explain_no_vpls
from deferred_ir.graph.facts import Facts
from deferred_ir.graph.params import param
from deferred_ir.graph.pass_base import Pass
from deferred_ir.graph.ports import Description, Input, Output, Texture
from deferred_ir.pool.samples import draw_samples, read_layout


@dataclass(frozen=True)
class Params:
    """Parameters of the choice."""

    draws: int = param(32, lo=1, hi=4096, doc="VPLs of the list that a sample looks at (M); `rays` divides it.")
    rays: int = param(4, lo=1, hi=4, doc="VPLs that it keeps (K), each of which a ray is traced to.")


class ChooseVpls(Pass):
    """The VPLs of each sample."""

    Params = Params
    inputs: ClassVar[Mapping[str, Input]] = {
        "layout": Input("where samples stand", format="layout"),
        "vpls": Input("the pool: its cone", format="vpl"),
        "positions": Input("where samples are", format="rgba32f"),
        "sample_normals": Input("their normals", format="rgba16"),
        "pixels": Input("their pixels", format="r32ui"),
        "list_positions": Input("VPLs for each tile: position, power times weight", format="rgba32f"),
        "list_normals": Input("normal, clamp^2", format="rgba32f"),
    }

    def outputs(self, inputs: Mapping[str, Description | None]) -> Mapping[str, Output]:
        """Return two textures of the frame's size. Raises GraphError where a list is too short."""
        p, lists = self.params, inputs["list_positions"]
        assert isinstance(lists, Texture)
        entries = lists.size[0] if lists.size else 0
        if p.draws % p.rays or entries % p.draws:
            raise GraphError(
                f"draws {p.draws}, rays {p.rays} and {entries} entries of a list: each must divide the next; "
                f"try rays 4, draws 32 and list_vpls.entries 512"
            )
        defines = {"RAYS": p.rays}
        return {
            "choices": Output("places in the lists, tile by tile", Texture("rgba32ui"), defines, transient=True),
            "weights": Output("by which each choice stands for others", Texture("rgba32f"), transient=True),
        }

    def depends(self) -> frozenset[str]:
        """The seed."""
        return frozenset({"seed"})

    def unneeded(self, facts: Facts) -> str | None:
        """Leave the pass out where there are no VPLs."""
        return explain_no_vpls(facts)

    def execute(self, frame: Frame, io: Io) -> None:
        """Choose."""
        defines = {"SMOOTH": int(frame.smooth), "DRAWS": self.params.draws}
        program = io.program("choose_vpls.frag", defines=defines)
        program.set(frame_seed=frame.seed & 0x7FFFFFFF, area=frame.scene.geometry.diagonal**2)
        draw_samples(io, program, read_layout(io))


PASS = ChooseVpls
