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
from deferred_ir.graph.stages import Stage, stage_param
from deferred_ir.pool.effort import accept_effort, read_effort
from deferred_ir.pool.samples import draw_samples, read_layout

MOST_RAYS = 16
"""Four in a texture, and OpenGL promises eight to draw into, half of which take the weights."""


@dataclass(frozen=True)
class Params:
    """Parameters of the choice."""

    draws: int = param(32, lo=1, hi=4096, doc="VPLs of the list that a sample looks at (M); `rays` divides it.")
    rays: int = param(4, lo=1, hi=MOST_RAYS, doc="VPLs that it keeps (K), each of which a ray is traced to.")
    stage: Stage = stage_param()


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
        "effort": accept_effort("factor on `draws` and `rays`"),
    }

    def outputs(self, inputs: Mapping[str, Description | None]) -> Mapping[str, Output]:
        """Return two textures of the frame's size. Raises GraphError where a list is too short."""
        lists, effort = inputs["list_positions"], read_effort(inputs)
        assert isinstance(lists, Texture)
        entries = lists.size[0] if lists.size else 0
        draws, rays = self.params.draws * effort, self.params.rays * effort
        if rays > MOST_RAYS:
            raise GraphError(
                f"rays {self.params.rays} times {effort}, the effort for so many VPLs: at most {MOST_RAYS}; "
                f"use rays {MOST_RAYS // effort}"
            )
        if draws % rays or entries % draws:
            raise GraphError(
                f"rays {rays}, draws {draws} and {entries} entries of a list: each must divide the next; "
                f"try rays 4, draws 32 and list_vpls.entries 512"
            )
        layers = -(-rays // 4)
        defines = {"RAYS": rays, "CHOICE_LAYERS": layers}
        which, weights = Texture("rgba32ui", layers=layers), Texture("rgba32f", layers=layers)
        return {
            "choices": Output(
                "places in the lists, tile by tile; four a layer", which, defines, image=True, transient=True
            ),
            "weights": Output("by which each choice stands for others", weights, image=True, transient=True),
        }

    def depends(self) -> frozenset[str]:
        """The seed."""
        return frozenset({"seed"})

    def unneeded(self, facts: Facts) -> str | None:
        """Leave the pass out where there are no VPLs."""
        return explain_no_vpls(facts)

    def execute(self, frame: Frame, io: Io) -> None:
        """Choose."""
        draws = self.params.draws * read_effort(io.step.descriptions)
        defines = {"SMOOTH": int(frame.smooth), "DRAWS": draws}
        program = io.stage_program("choose_vpls/choose", defines)
        program.set(frame_seed=frame.seed & 0x7FFFFFFF, area=frame.scene.geometry.diagonal**2)
        draw_samples(io, program, read_layout(io))


PASS = ChooseVpls
