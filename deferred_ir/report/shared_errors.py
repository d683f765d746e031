"""What all frames of a plan get wrong alike, which an estimate of the error from frames cannot see."""

from __future__ import annotations

from deferred_ir.engine.setup import UNFILTERED
from deferred_ir.graph.graph import Plan


def list_shared_errors(plan: Plan) -> list[str]:
    """Return what the passes behind the plan's radiance say of it, "pass: what".

    Where `unfiltered` is drawn, too, those behind that: what a filter does is then seen.
    """
    outputs = plan.outputs
    wanted = {outputs.get(UNFILTERED, outputs["radiance"])[0]}
    found = []
    for step in reversed(plan.steps):
        if step.name in wanted:
            wanted |= {source[0] for source in step.sources.values() if source}
            if why := step.work.explain_shared_error(plan.facts, step.descriptions):
                found.append(f"{step.name}: {why}")
    return found[::-1]
