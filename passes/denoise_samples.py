"""Denoise the light of samples by Open Image Denoise: irradiance, filtered irradiance of samples -> irradiance."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from deferred_ir.frame.frame import Frame
from deferred_ir.frame.pass_io import Io
from deferred_ir.frame.vpl_params import explain_no_vpls
from deferred_ir.graph.facts import Facts
from deferred_ir.graph.params import param
from deferred_ir.graph.pass_base import Pass
from deferred_ir.graph.ports import Description, Input, Output, Texture
from deferred_ir.pool.denoiser import Denoiser, Quality, find_obstacle
from deferred_ir.pool.samples import read_layout


@dataclass(frozen=True)
class Params:
    """Parameters of the denoiser."""

    quality: Quality = param(
        "balanced", doc="Fast takes half the time, and leaves faint wiggles where light is even and noisy."
    )


class DenoiseSamples(Pass):
    """Denoised irradiance of the grid's samples; those of the list keep their filtered light."""

    Params = Params
    State = Denoiser
    inputs: ClassVar[Mapping[str, Input]] = {
        "layout": Input("where samples stand", format="layout"),
        "irradiance": Input("irradiance of samples", format="rgba32f"),
        "filtered": Input("the same, filtered inside surfaces", format="rgba32f"),
    }

    def outputs(self, inputs: Mapping[str, Description | None]) -> Mapping[str, Output]:
        """Return one texture of the frame's size."""
        del inputs
        return {"denoised": Output("irradiance", Texture("rgba32f"), attach=False, transient=True)}

    def find_obstacle(self) -> str | None:
        """The wheel of the denoiser is an extra."""
        return find_obstacle()

    def depends(self) -> frozenset[str]:
        """Nothing of the frame."""
        return frozenset()

    def unneeded(self, facts: Facts) -> str | None:
        """Leave the pass out where there are no VPLs."""
        return explain_no_vpls(facts)

    def explain_shared_error(self, facts: Facts, inputs: Mapping[str, Description | None]) -> str | None:
        """Say that light is denoised."""
        del facts, inputs
        return "the denoiser blurs light inside surfaces"

    def execute(self, frame: Frame, io: Io) -> None:
        """Denoise on the CPU."""
        del frame
        layout = read_layout(io)
        columns, rows = layout.grid
        grid = np.s_[:rows, :columns, :3]
        noisy, filtered = io["irradiance"].read(), io["filtered"].read()
        image = np.zeros_like(filtered)
        for x, y, width, height in layout.list_rectangles():
            samples = np.s_[y : y + height, x : x + width]
            image[samples] = filtered[samples]
        image[grid] = io.state.denoise(noisy[grid], filtered[grid], self.params.quality)
        io["denoised"].upload(image)


PASS = DenoiseSamples
