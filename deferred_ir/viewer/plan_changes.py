"""What of a plan differs from another, and a plan with another exposure."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from deferred_ir.graph.graph import Plan, Step


def changed(old: Plan, new: Plan) -> set[str]:
    """Names of the steps of `new` whose results may differ from those that `old` left behind."""
    before = {step.name: _identity(step) for step in old.steps}
    found: set[str] = set()
    for step in new.steps:
        fed = any(source and source[0] in found for source in step.sources.values())
        if fed or before.get(step.name) != _identity(step):
            found.add(step.name)
    return found


def _identity(step: Step) -> tuple[Any, ...]:
    return type(step.work), step.work.params, dict(step.sources), dict(step.outputs), dict(step.descriptions)


def exposed(plan: Plan, stops: float) -> Plan:
    """`plan` with `stops` wherever a pass's exposure is automatic; itself where none is."""
    steps = [
        replace(step, work=type(step.work)(replace(step.work.params, exposure=stops))) if _automatic(step) else step
        for step in plan.steps
    ]
    return replace(plan, steps=tuple(steps)) if any(map(_automatic, plan.steps)) else plan


def _automatic(step: Step) -> bool:
    return getattr(step.work.params, "exposure", None) == "auto"
