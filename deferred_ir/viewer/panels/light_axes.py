"""Draws light and VPLs as their axes: x red, y green, z, where they shine, blue. Lights behind surfaces are dim."""

from __future__ import annotations

from typing import Any

import numpy as np

from deferred_ir.base.arrays import Array, Bools
from deferred_ir.frame.vpl_buffer import make_axes
from deferred_ir.gl.buffers import GpuBuffer
from deferred_ir.viewer.canvas import Area
from deferred_ir.viewer.session import Session

LENGTH = 0.02
"""Length of a VPL's axes in diagonals of the scene; the spotlight's are three times as long."""
COLORS = ((1.0, 0.25, 0.2), (0.3, 0.9, 0.3), (0.3, 0.5, 1.0))
DIM = 0.25


def find_records(session: Session, kind: str) -> np.ndarray | None:
    """Return the records of the last frame in the first buffer of format `kind`, "light" or "vpl"."""
    for step in session.plan.steps:
        for port, output in step.outputs.items():
            if getattr(output.description, "format", "") == kind:
                found = session.output((step.name, port))
                return found.records if isinstance(found, GpuBuffer) else None
    return None


def find_bases(session: Session) -> tuple[Array, Array] | None:
    """Return where direct lights and VPLs are, (n, 3), direct lights first, and their axes x, y, z, (n, 3, 3)."""
    lights, vpls = find_records(session, "light"), find_records(session, "vpl")
    if lights is None or vpls is None:
        return None
    forward = lights["axis"].astype(float)
    of_lights = np.stack([*make_axes(forward, 90.0)[:2], forward], axis=1)
    of_vpls = np.stack([vpls[name] for name in ("x_axis", "y_axis", "z_axis")], axis=1).astype(float)
    axes = np.concatenate([of_lights, of_vpls])
    axes /= np.maximum(np.linalg.norm(axes, axis=-1, keepdims=True), 1e-30)
    return np.concatenate([lights["position"], vpls["position"]]).astype(float), axes


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


def draw_axes(imgui: Any, session: Session, area: Area, window_height: int, covered: int = 0) -> None:
    """Draw all lights over the picture in `area`, except over a square of `covered` pixels in its lower left corner."""
    bases = find_bases(session)
    if bases is None:
        return
    (origin, axes), centre = bases, session.scene.geometry.centre
    direct = np.arange(len(origin)) < len(session.renderer.executor.resource(("lights", "lights")).records)
    length = LENGTH * session.scene.geometry.diagonal * np.where(direct, 3, 1)
    tips = origin[:, None] + axes * length[:, None, None]
    tracer = session.renderer.tracer()
    lifted = tracer.lift(origin, axes[:, 2])
    hidden = tracer.occluded(np.broadcast_to(np.subtract(session.eye.position, centre), lifted.shape), lifted)
    origin, tips = origin + centre, tips + centre
    start, start_seen = project(origin, session)
    end, end_seen = project(tips.reshape(-1, 3), session)
    end, end_seen = end.reshape(-1, 3, 2), end_seen.reshape(-1, 3)
    shift = np.array([area.x, window_height - area.y - area.height])
    lines = imgui.get_background_draw_list()
    lines.push_clip_rect(imgui.ImVec2(*shift), imgui.ImVec2(shift[0] + area.width, shift[1] + area.height))
    free = (start[:, 0] > covered) | (start[:, 1] < session.size[1] - covered)
    for i in np.flatnonzero(start_seen & free):
        for axis, color in enumerate(COLORS):
            if end_seen[i, axis]:
                packed = imgui.get_color_u32(imgui.ImVec4(*color, DIM if hidden[i] else 1.0))
                a, b = start[i] + shift, end[i, axis] + shift
                lines.add_line(imgui.ImVec2(*a), imgui.ImVec2(*b), packed, 3.0 if direct[i] else 1.5)
    lines.pop_clip_rect()
