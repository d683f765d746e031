"""What of a plan differs from another, and a plan with another exposure."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from deferred_ir.graph.graph import Plan, Step
from deferred_ir.graph.roles import find_parameter


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
    steps = tuple(_expose(step, stops) for step in plan.steps)
    return plan if steps == plan.steps else replace(plan, steps=steps)


def _expose(step: Step, stops: float) -> Step:
    """Return `step` with an exposure of `stops` if its own is automatic, else itself."""
    name = find_parameter(step.work, "exposure")
    if name is None or getattr(step.work.params, name) != "auto":
        return step
    return replace(step, work=type(step.work)(replace(step.work.params, **{name: stops})))
