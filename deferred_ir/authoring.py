"""What authors of passes import, in one place; docs/adding-a-pass.md is the guide."""

from __future__ import annotations

from deferred_ir.base.errors import GraphError
from deferred_ir.engine.unwritten_reads import unwritten_reads
from deferred_ir.frame.facts import EMITS, PIXELS, SOFTWARE, TRIANGLES
from deferred_ir.frame.frame import Frame
from deferred_ir.frame.fullscreen import FullscreenPass
from deferred_ir.frame.pass_io import Io
from deferred_ir.frame.vpl_params import CLAMP, CLAMP_RETURNED, CLAMPED, CONE, SHARES, VPLS
from deferred_ir.graph.facts import Fact, Facts, Statements
from deferred_ir.graph.figures import Figure
from deferred_ir.graph.params import param
from deferred_ir.graph.pass_base import Pass
from deferred_ir.graph.ports import Buffer, Description, Input, Output, Texture
from deferred_ir.graph.stages import Stage, stage_param
from deferred_ir.report.plan_text import summary

__all__ = [
    "CLAMP",
    "CLAMPED",
    "CLAMP_RETURNED",
    "CONE",
    "EMITS",
    "PIXELS",
    "SHARES",
    "SOFTWARE",
    "TRIANGLES",
    "VPLS",
    "Buffer",
    "Description",
    "Fact",
    "Facts",
    "Figure",
    "Frame",
    "FullscreenPass",
    "GraphError",
    "Input",
    "Io",
    "Output",
    "Pass",
    "Stage",
    "Statements",
    "Texture",
    "param",
    "stage_param",
    "summary",
    "unwritten_reads",
]
