"""Draws the lights of the list as the lines that each kind says show it, the selected one highlighted."""

from __future__ import annotations

import numpy as np

from deferred_ir.base.arrays import Array
from deferred_ir.viewer.panels.lines import Overlay, find_hidden
from deferred_ir.viewer.session import Session

MOST = 200
"""Lights whose lines are drawn, the first ones and the selected one."""
ON, OFF, SELECTED = (1.0, 0.75, 0.2), (0.5, 0.5, 0.5), (1.0, 1.0, 1.0)
WIDTH = 1.5
"""Of lines, pixels; those of the selected light are twice as wide."""


def find_outlines(session: Session) -> list[tuple[Array, tuple[float, float, float]]]:
    """Return the lines of lights, (n, 2, 3) in world space, and their colours; the selected light comes last."""
    lights, bounds = session.lights, session.scene.bounds
    found = [
        (entry.light.outline(bounds), ON if entry.on else OFF)
        for number, entry in enumerate(lights.entries[:MOST])
        if number != lights.selected
    ]
    return found + ([(lights.light.outline(bounds), SELECTED)] if lights.entries else [])


def draw_outlines(overlay: Overlay) -> None:
    """Draw the lines over the picture."""
    session = overlay.session
    outlines = find_outlines(session)
    if not outlines or session.drawn is None:
        return
    *others, selected = outlines
    for group, width in ((others, WIDTH), ([selected], 2 * WIDTH)):
        if group:
            lines = np.concatenate([lines for lines, _ in group])
            colors = np.repeat([color for _, color in group], [len(lines) for lines, _ in group], axis=0)
            overlay.draw(lines, colors, find_hidden(lines.mean(axis=1), session), width)
