"""Figures that all passes publish which draw shadow maps."""

from __future__ import annotations

from deferred_ir.graph.figures import Figure

MAPS_DRAWN = Figure("maps_drawn", "Shadow maps that were drawn.", ("maps_drawn",), each_frame=True)
STAND_IN_TRIANGLES = Figure(
    "stand_in_triangles",
    "Triangles of the mesh that maps of VPLs draw in the scene's place.",
    ("stand_in", "triangles"),
)
STAND_IN_BYTES = Figure("stand_in_bytes", "Bytes of that mesh on the device.", ("stand_in", "bytes"))
ALL = (MAPS_DRAWN, STAND_IN_TRIANGLES, STAND_IN_BYTES)
