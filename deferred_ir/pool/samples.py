"""The layout of a frame's samples as a port: who chooses samples writes it, and who draws them reads it."""

from __future__ import annotations

import numpy as np

from deferred_ir.frame.pass_io import Io
from deferred_ir.gl.shaders import Program
from deferred_ir.graph.ports import Buffer, Output
from deferred_ir.pool.layout import Layout

LAYOUT = np.dtype([("size", "i4", 2), ("scale", "i4"), ("offset", "i4", 2), ("listed", "i4")])
"""The one record of the port: fields of `Layout`."""


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
