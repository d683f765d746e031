"""Which steps of a plan differ from those of another."""

from __future__ import annotations

from typing import Any

from deferred_ir.graph.graph import Plan, Step


def find_changed(old: Plan, new: Plan) -> set[str]:
    """Return the names of the steps of `new` whose results may differ from those that `old` left behind."""
    before = {step.name: _identify(step) for step in old.steps}
    changed: set[str] = set()
    for step in new.steps:
        reads_changed = any(source and source[0] in changed for source in step.sources.values())
        if reads_changed or before.get(step.name) != _identify(step):
            changed.add(step.name)
    return changed


def _identify(step: Step) -> tuple[Any, ...]:
    """Return all that a step's results depend on, apart from the scene and what earlier steps write."""
    return type(step.work), step.work.params, dict(step.sources), dict(step.outputs), dict(step.descriptions)
