"""Draws the lights of the list as the lines that each kind says show it, the selected one highlighted."""

from __future__ import annotations

import numpy as np

from deferred_ir.base.arrays import Array
from deferred_ir.viewer.panels.lines import Color, Overlay, find_hidden
from deferred_ir.viewer.session import Session

MOST = 100
"""Lights whose lines are drawn, the first ones and the selected one."""
ON, OFF, SELECTED = (1.0, 0.75, 0.2), (0.5, 0.5, 0.5), (1.0, 1.0, 1.0)
WIDTH = 1.5
"""Of lines, pixels; those of the selected light are twice as wide."""


def find_outlines(session: Session) -> dict[Color, Array]:
    """Return the lines of lights, (n, 2, 3) in world space, by their colours; the selected light comes last."""
    lights, bounds = session.lights, session.scene.bounds
    found: dict[Color, list[Array]] = {ON: [], OFF: [], SELECTED: []}
    for number, entry in enumerate(lights.entries):
        if number == lights.selected:
            found[SELECTED].append(entry.light.outline(bounds))
        elif number < MOST:
            found[ON if entry.on else OFF].append(entry.light.outline(bounds))
    return {color: np.concatenate(lines) for color, lines in found.items() if lines}


def draw_outlines(overlay: Overlay) -> None:
    """Draw the lines over the picture."""
    session = overlay.session
    if session.drawn is None:
        return
    for color, lines in find_outlines(session).items():
        width = 2 * WIDTH if color == SELECTED else WIDTH
        overlay.draw(lines, color, find_hidden(lines.mean(axis=1), session), width)
