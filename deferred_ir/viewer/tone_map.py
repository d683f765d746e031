"""Tone-maps a second image like the picture on screen, through the graph's own passes."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from deferred_ir.engine.accumulation import find_readers
from deferred_ir.graph.graph import Plan, Step
from deferred_ir.graph.roles import find_parameter
from deferred_ir.output.exposure import compute_stops
from deferred_ir.viewer.session import Session


def find_exposure(session: Session) -> float | None:
    """Return the exposure of the picture on screen in stops; None if it is a setting, not automatic."""
    if not any(map(_find_automatic, session.plan.steps)):
        return None
    return compute_stops(session.image().radiance)


def tone_map(session: Session, radiance: Any, stops: float | None) -> np.ndarray:
    """Return display pixels of `radiance` (H, W, 3), top row first: uint8 (H, W, 4), bottom row first.

    stops: used where the exposure is automatic, so that two images are shown alike. The picture on screen is drawn
    again afterwards.
    """
    plan = session.plan if stops is None else _set_exposure(session.plan, stops)
    source = plan.outputs["radiance"]
    late = find_readers(plan, source)
    texture = session.output(source)
    pixels = np.ones((*radiance.shape[:2], 4), np.float32)
    pixels[..., :3] = radiance[::-1]
    with session.renderer.gpu.ctx:
        before = texture.read()
        try:
            texture.upload(pixels)
            session.renderer.draw(session.shown, plan, seed=session.seed, steps=late)
            display: np.ndarray = session.output(plan.outputs["display"]).read()
        finally:
            texture.upload(before)
            session.renderer.draw(session.shown, session.plan, seed=session.seed, steps=late)
    return display


def _set_exposure(plan: Plan, stops: float) -> Plan:
    """Return `plan` with `stops` wherever a pass's exposure is automatic."""
    return replace(plan, steps=tuple(_expose(step, stops) for step in plan.steps))


def _expose(step: Step, stops: float) -> Step:
    name = _find_automatic(step)
    if name is None:
        return step
    return replace(step, work=type(step.work)(replace(step.work.params, **{name: stops})))


def _find_automatic(step: Step) -> str | None:
    """Return the name of the pass's exposure if that is automatic, else None."""
    name = find_parameter(step.work, "exposure")
    return name if name is not None and getattr(step.work.params, name) == "auto" else None
