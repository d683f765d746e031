"""The layout of a frame's samples as a port: who chooses samples writes it, and who draws them reads it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from deferred_ir.base.errors import GraphError
from deferred_ir.frame.pass_io import Io
from deferred_ir.gl.shaders import Program
from deferred_ir.graph.ports import Buffer, Description, Input, Output
from deferred_ir.pool.layout import Layout

LAYOUT = np.dtype([("size", "i4", 2), ("scale", "i4"), ("offset", "i4", 2), ("listed", "i4")])
"""The one record of the port: fields of `Layout`."""

ASKERS: Mapping[str, Input] = {
    "depth": Input("reversed depth, if all pixels ask", format="depth32f", optional=True),
    "layout": Input("where samples stand, if these ask and not all pixels", format="layout", optional=True),
    "positions": Input("where samples are", format="rgba32f", optional=True),
    "normals": Input("shading and geometric normal, of pixels or of samples", format="rgba16"),
}
"""Inputs of passes for which pixels or samples ask (shaders/lib/shares/askers.glsl)."""


def check_askers(inputs: Mapping[str, Description | None]) -> None:
    """Raise GraphError unless pixels or samples ask, one of them, by the ports of `ASKERS`."""
    samples = {inputs["layout"] is not None, inputs["positions"] is not None}
    if samples != {inputs["depth"] is None}:
        raise GraphError("connect either depth, for all pixels, or layout and positions, for samples")


def describe_layout() -> Output:
    """Return the port of a frame's layout."""
    return Output("where samples stand, for the CPU", Buffer("layout", 1, LAYOUT.itemsize))


def write_layout(io: Io, layout: Layout) -> None:
    """Fill the output `layout`."""
    record = np.zeros(1, LAYOUT)
    record["size"], record["scale"] = layout.size, layout.scale
    record["offset"], record["listed"] = layout.offset, layout.listed
    io["layout"].write(record)


def read_layout(io: Io) -> Layout:
    """Return what the input `layout` holds."""
    record = io["layout"].records[0]
    (width, height), (x, y) = record["size"].tolist(), record["offset"].tolist()
    return Layout((width, height), int(record["scale"]), (x, y), int(record["listed"]))


def draw_samples(io: Io, program: Program, layout: Layout) -> None:
    """Run a program for each sample: draw the parts of the bound target that hold samples, or dispatch for them."""
    io.cover(program, layout.list_rectangles())


def draw_askers(io: Io, program: Program) -> None:
    """Draw all that asks by the ports of `ASKERS`: the frame's pixels, or the samples."""
    if io["layout"]:
        layout = read_layout(io)
        program.set(grid=layout.grid)
        draw_samples(io, program, layout)
    else:
        program.draw_fullscreen()
