"""Draws VPLs as their axes: x red, y green, z, where they shine, blue. VPLs behind surfaces are dim."""

from __future__ import annotations

import numpy as np

from deferred_ir.base.arrays import Array
from deferred_ir.gl.buffers import GpuBuffer
from deferred_ir.viewer.panels.lines import Overlay, find_hidden
from deferred_ir.viewer.session import Session

LENGTH = 0.02
"""Length of a VPL's axes in diagonals of the scene."""
COLORS = (1.0, 0.25, 0.2), (0.3, 0.9, 0.3), (0.3, 0.5, 1.0)
WIDTH = 1.5
"""Of lines, pixels."""


def find_records(session: Session, kind: str) -> np.ndarray | None:
    """Return the records of the last frame in the first buffer of format `kind`, "light" or "vpl"."""
    for step in session.plan.steps:
        for port, output in step.outputs.items():
            if getattr(output.description, "format", "") == kind:
                found = session.output((step.name, port))
                return found.records if isinstance(found, GpuBuffer) else None
    return None


def find_bases(session: Session) -> tuple[Array, Array] | None:
    """Return where VPLs are, (n, 3), in the renderer's coordinates, and their axes x, y, z, (n, 3, 3)."""
    vpls = find_records(session, "vpl")
    if vpls is None:
        return None
    axes = np.stack([vpls[name] for name in ("x_axis", "y_axis", "z_axis")], axis=1).astype(float)
    axes /= np.maximum(np.linalg.norm(axes, axis=-1, keepdims=True), 1e-30)
    return vpls["position"].astype(float), axes


def draw_axes(overlay: Overlay) -> None:
    """Draw the axes of all VPLs over the picture."""
    session = overlay.session
    bases = find_bases(session)
    if bases is None:
        return
    (origin, axes), centre = bases, session.scene.geometry.centre
    tips = origin[:, None] + axes * LENGTH * session.scene.geometry.diagonal
    lines = np.stack([np.broadcast_to(origin[:, None], tips.shape), tips], axis=2) + centre
    hidden = find_hidden(session.renderer.tracer().lift(origin, axes[:, 2]) + centre, session)
    for axis, color in enumerate(COLORS):
        overlay.draw(lines[:, axis], color, hidden, WIDTH)
