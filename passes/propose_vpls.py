"""Draw a list of VPLs for each tile of the image, by what they would bring to it: pool, samples -> lists.

A shader scores a VPL of each group of the pool at a few samples of each tile, without shadows. The lists are drawn on
the CPU (deferred_ir/pool/proposals.py).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from deferred_ir.base.colour import LUMINANCE
from deferred_ir.frame.frame import Frame
from deferred_ir.frame.pass_io import Io
from deferred_ir.frame.vpl_params import explain_no_vpls
from deferred_ir.graph.facts import Facts
from deferred_ir.graph.params import param
from deferred_ir.graph.pass_base import Pass
from deferred_ir.graph.ports import Buffer, Description, Input, Output, Texture
from deferred_ir.pool.proposals import GROUPS, TEXELS, Groups, draw_lists
from deferred_ir.pool.samples import read_layout
from deferred_ir.sampling import streams

TILES = 16
"""Tiles along an edge of the image, whatever its size."""
NUMBER = np.dtype("u4")


@dataclass(frozen=True)
class Params:
    """Parameters of the lists."""

    entries: int = param(512, lo=16, hi=4096, doc="VPLs in the list of a tile.")


class ProposeVpls(Pass):
    """A list of VPLs for each of TILES x TILES tiles."""

    Params = Params
    inputs: ClassVar[Mapping[str, Input]] = {
        "layout": Input("where samples stand", format="layout"),
        "vpls": Input("the pool", format="vpl"),
        "groups": Input("a VPL of each of its groups", format="rgba32f"),
        "positions": Input("where samples are", format="rgba32f"),
        "sample_normals": Input("their normals", format="rgba16"),
    }

    def outputs(self, inputs: Mapping[str, Description | None]) -> Mapping[str, Output]:
        """Return the scores of groups in tiles, and the lists."""
        del inputs
        numbers = Buffer("number", self.params.entries * TILES**2, NUMBER.itemsize)
        lists = Texture("rgba32f", (TEXELS * self.params.entries, TILES**2))
        defines: dict[str, int | float] = {"LIST_ENTRIES": self.params.entries, "TILES": TILES}
        return {
            "scores": Output("what each group would bring to each tile", Texture("r32f", (GROUPS, TILES**2))),
            "numbers": Output("numbers in the pool of the VPLs of all lists", numbers),
            "lists": Output("a row for each tile, four texels a VPL", lists, defines, attach=False),
        }

    def depends(self) -> frozenset[str]:
        """What samples see, which the camera says, and the seed."""
        return frozenset({"camera", "models", "seed"})

    def unneeded(self, facts: Facts) -> str | None:
        """Leave the pass out where there are no VPLs."""
        return explain_no_vpls(facts)

    def execute(self, frame: Frame, io: Io) -> None:
        """Score, read back, draw lists, upload."""
        records, rng = io["vpls"].records, streams.pool_lists(frame.seed)
        program = io.program("propose_vpls.frag", defines={"SMOOTH": int(frame.smooth)})
        grid = read_layout(io).grid
        program.set(grid=grid, shift=rng.random(2).tolist(), area=frame.scene.geometry.diagonal**2)
        program.draw_fullscreen()
        groups = Groups.of_power(records["emission"] @ LUMINANCE)
        scores = io["scores"].read()[..., 0][:, : len(groups.power)]
        found, weight = draw_lists(scores, groups, self.params.entries, rng)
        io["numbers"].write(found.reshape(-1).astype(NUMBER))
        io["lists"].upload(_pack_lists(records, found, weight))


def _pack_lists(records: np.ndarray, found: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Return the texels (tiles, TEXELS * entries, 4) of the VPL records `found` (tiles, entries) with these weights."""
    tiles, entries = found.shape
    if not len(records):
        return np.zeros((tiles, TEXELS * entries, 4), np.float32)
    power = records["emission"] @ LUMINANCE
    pool = np.zeros((len(records), TEXELS, 4), np.float32)
    pool[:, 0, :3], pool[:, 1, :3], pool[:, 2, :3] = (records[name] for name in ("position", "z_axis", "emission"))
    pool[:, 0, 3] = power / max(float(power.sum(dtype=float)), np.finfo(float).tiny)
    pool[:, 1, 3], pool[:, 2, 3] = records["clamp_squared"], 1
    texels: np.ndarray = pool[found]
    texels[..., 0, 3] *= weight
    texels[..., 2, 3] *= weight
    return texels.reshape(tiles, TEXELS * entries, 4)


PASS = ProposeVpls
