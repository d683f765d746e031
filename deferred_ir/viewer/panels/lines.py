"""Draws lines of world space over the picture, dim where surfaces hide them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from deferred_ir.base.arrays import Array, Bools
from deferred_ir.viewer.canvas import Area
from deferred_ir.viewer.session import Session

Color = tuple[float, float, float]
"""Red, green and blue of the display."""
DIM = 0.25
"""Opacity of a line behind a surface."""


def project(points: Array, session: Session) -> tuple[Array, Bools]:
    """Project world points (n, 3). Returns pixels (n, 2) of the picture, y down, and which lie before the eye, (n,)."""
    eye, (width, height) = session.eye, session.size
    a, b, c = eye.ray_axes((width, height))
    d = points - np.asarray(eye.position)
    depth = d @ c
    front = depth > 1e-6 * session.scene.geometry.diagonal
    w = np.where(front, depth, 1.0)
    x, y = d @ a / (a @ a) / w, d @ b / (b @ b) / w
    return np.stack([(x + 1) / 2 * width, (1 - y) / 2 * height], axis=-1), front


def find_hidden(points: Array, session: Session) -> Bools:
    """Return which of world points (n, 3) surfaces hide from the eye, (n,)."""
    centre = session.scene.geometry.centre
    eye = np.broadcast_to(np.subtract(session.eye.position, centre), points.shape)
    return session.renderer.tracer().occluded(eye, points - centre)


@dataclass(frozen=True)
class Overlay:
    """Draws over the picture in `area` of a window of some height, but not over its corner.

    covered: edge of the square in the lower left corner that a shadow map takes, pixels.
    """

    imgui: Any
    session: Session
    area: Area
    window_height: int
    covered: int = 0

    def draw(self, lines: Array, color: Color, hidden: Bools, width: float) -> None:
        """Draw lines (n, 2, 3) that lie before the eye. hidden: which are dim, (n,); width: pixels."""
        imgui, area = self.imgui, self.area
        ends, front = project(lines.reshape(-1, 3), self.session)
        ends, front = ends.reshape(-1, 2, 2), front.reshape(-1, 2)
        free = (ends[:, 0, 0] > self.covered) | (ends[:, 0, 1] < self.session.size[1] - self.covered)
        shift = np.array([area.x, self.window_height - area.y - area.height])
        drawing = imgui.get_background_draw_list()
        drawing.push_clip_rect(imgui.ImVec2(*shift), imgui.ImVec2(shift[0] + area.width, shift[1] + area.height))
        drawn = front.all(axis=1) & free
        bright, dim = (imgui.get_color_u32(imgui.ImVec4(*color, opacity)) for opacity in (1.0, DIM))
        # Plain numbers: there may be ten thousand lines, and arrays of two would cost more than drawing them.
        for (start, end), is_dim in zip((ends[drawn] + shift).tolist(), hidden[drawn].tolist(), strict=True):
            drawing.add_line(start, end, dim if is_dim else bright, width)
        drawing.pop_clip_rect()
