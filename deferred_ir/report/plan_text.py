"""Write a plan for people: what runs, in what order, what was left out and why; as text or for Graphviz."""

from __future__ import annotations

from deferred_ir.graph.graph import Graph, Plan
from deferred_ir.report import left_out
from deferred_ir.scene.scene import Scene


def summary(plan: Plan, scene: Scene | None = None) -> str:
    """Describe each step: what it reads, what it writes and how long that lives; then what was left out.

    scene: whose frames the plan is for, to tell what its shaders do without.
    """
    lines = []
    for number, step in enumerate(plan.steps):
        lines.append(f"{number + 1}. {step.name}" + (f"  ({kind})" if (kind := _kind(step.work, step.name)) else ""))
        for port, source in step.sources.items():
            lines.append(f"     reads  {port}: " + (".".join(source) if source else "not connected (optional)"))
        for port, output in step.outputs.items():
            last = plan.lifetimes[step.name, port][1]
            until = f"until {plan.steps[last].name}" if last > number else "read by nobody"
            until = "an output" if (step.name, port) in plan.outputs.values() else until
            lines.append(f"     writes {port}: {output.description}, {until}; {output.doc}")
        lines += [f"     {line}" for line in _subpasses(plan, number)]
    lines.append("outputs: " + ", ".join(f"{name} = {'.'.join(source)}" for name, source in plan.outputs.items()))
    lines += [f"left out: {name}: {why}" for name, why in plan.left_out.items()]
    if scene:
        lines += [f"left out: {entry.what}: {entry.why}" for entry in left_out.list_for_scene(scene)]
    return "\n".join(lines)


def _kind(work: object, name: str) -> str:
    kind = type(work).__module__.rpartition(".")[2]
    return "" if kind == name else kind


def _subpasses(plan: Plan, number: int) -> list[str]:
    """Describe the sub-passes of a step; of more than six only the first three and the last."""
    step = plan.steps[number]
    parts = [", ".join(f"{k} {v}" for k, v in part.items()) for part in step.work.subpasses(step.descriptions)]
    if len(parts) > 6:
        parts = [*parts[:3], f"... {len(parts) - 4} more ...", parts[-1]]
    return [f"sub-pass {part}" for part in parts]


def dot(graph: Graph, plan: Plan) -> str:
    """Return the graph as Graphviz source; what was left out is grey and says why."""
    lines = ["digraph plan {", "  rankdir=LR;", '  node [shape=box, fontname="sans-serif"];']
    for name in graph.nodes:
        why = plan.left_out.get(name)
        label = name if why is None else f"{name}\\n{why}"
        lines.append(f"  {_quoted(name)} [label={_quoted(label)}{', color=grey, fontcolor=grey' if why else ''}];")
    for node in graph.nodes.values():
        for port, text in node.inputs.items():
            source, _, output = text.partition(".")
            dim = ", style=dashed, color=grey" if {source, node.name} & plan.left_out.keys() else ""
            label = output if output == port else f"{output} > {port}"
            lines.append(f"  {_quoted(source)} -> {_quoted(node.name)} [label={_quoted(label)}{dim}];")
    for name, (source, port) in plan.outputs.items():
        lines.append(f"  {_quoted('output ' + name)} [label={_quoted(name)}, shape=oval];")
        lines.append(f"  {_quoted(source)} -> {_quoted('output ' + name)} [label={_quoted(port)}];")
    return "\n".join([*lines, "}"])


def _quoted(text: str) -> str:
    return '"' + text.replace('"', "'") + '"'
