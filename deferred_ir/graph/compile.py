"""Compile a graph to a plan: resolve names, leave out, cull, order, describe, find lifetimes. Pure: no OpenGL.

Ideas: all faults at once (Falcor), compilation as a short list of steps (Granite), culling by a backward walk and tests
without a GPU (Filament).
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from graphlib import CycleError, TopologicalSorter
from typing import Any

from deferred_ir.base.errors import GraphError, did_you_mean
from deferred_ir.graph.facts import NOTHING_KNOWN, Fact, Facts
from deferred_ir.graph.graph import Graph, Plan, Step
from deferred_ir.graph.pass_base import Pass
from deferred_ir.graph.ports import Description, is_storable


def compile(
    graph: Graph,
    outputs: Sequence[str],
    facts: Facts = NOTHING_KNOWN,
    *,
    keep_all: bool = False,
    parts: Collection[str] | None = None,
) -> Plan:
    """Return the plan that produces `outputs` (names in graph.outputs) where `facts` hold.

    keep_all: leave nothing out that another scene would need. parts: names that `Pass.depends` may give, None for any.
    Raises one GraphError that lists all faults.
    """
    faults: list[str] = []
    roots, edges = _resolve(graph, outputs, faults)
    known = _gather_facts({node.name: node.work for node in graph.nodes.values()}, facts, faults)
    needs = known.forget_needs() if keep_all else known
    unneeded, ports = _leave_out(graph, edges, needs, faults)
    for name, (source, port) in roots.items():
        if source in unneeded:
            faults.append(f"output '{name}' comes from {source}, which is left out: {unneeded[source]}")
        elif (why := ports.get((source, port))) is not None:
            faults.append(f"output '{name}' is {source}.{port}, which is left out: {why}")
    reached = _reach(roots, edges, unneeded)
    steps = _describe(graph, edges, _order(edges, reached, faults), (known, parts), faults)
    if faults:
        text = " ".join("; ".join(faults).split())  # a name may hold a line break
        raise GraphError(f"{graph.origin}: {text}")
    left_out = {name: unneeded.get(name, "no requested output needs it") for name in graph.nodes if name not in reached}
    steps = tuple(_drop(step, {port for name, port in ports if name == step.name}) for step in steps)
    left_out |= {f"{name}.{port}": why for (name, port), why in ports.items() if name in reached}
    if not keep_all:
        steps, unread = _drop_spare(steps, roots)
        left_out |= unread
    running = _gather_facts({step.name: step.work for step in steps}, facts, faults)
    return Plan(steps, roots, left_out, _lifetimes(steps, roots), running, graph.origin)


Edges = dict[str, dict[str, tuple[str, str] | None]]
Roots = dict[str, tuple[str, str]]


def _resolve(graph: Graph, outputs: Sequence[str], faults: list[str]) -> tuple[Roots, Edges]:
    """Resolve names to (pass, port) pairs. Whether a source has that port is known once it is described."""

    def source(text: str, where: str) -> tuple[str, str] | None:
        name, dot, port = text.partition(".")
        if not dot or not name or not port:
            faults.append(f"{where}: '{text}' is no source; write \"pass.port\"")
        elif name not in graph.nodes:
            faults.append(f"{where}: no pass '{name}'{did_you_mean(name, graph.nodes)}")
        else:
            return name, port
        return None

    edges: Edges = {}
    for node in graph.nodes.values():
        edges[node.name] = dict.fromkeys(node.work.inputs)
        for port, text in node.inputs.items():
            if port not in node.work.inputs:
                faults.append(f"{node.name}: no input '{port}'{did_you_mean(port, node.work.inputs)}")
            else:
                edges[node.name][port] = source(text, f"{node.name}.{port}")
        for port, declared in node.work.inputs.items():
            if not declared.optional and port not in node.inputs:
                faults.append(f'{node.name}.{port}: not connected; add inputs = {{ {port} = "pass.port" }}')
    roots: Roots = {}
    for name in outputs:
        if name not in graph.outputs:
            faults.append(f"no output '{name}'{did_you_mean(name, graph.outputs)}")
        elif found := source(graph.outputs[name], f"outputs.{name}"):
            roots[name] = found
    return roots, edges


def _gather_facts(passes: Mapping[str, Pass], facts: Facts, faults: list[str]) -> Facts:
    """Add what the passes state to `facts`; a fact about which they contradict each other becomes unknown."""
    stated: dict[Fact[Any], Any] = {}
    for name, work in passes.items():
        for fact, value in work.state_facts(facts).items():
            if isinstance(fact, Fact):
                stated[fact] = value if stated.get(fact, value) == value else fact.unknown
            else:
                faults.append(f"{name}: state_facts(): {fact!r} is no Fact; give the constant that declares it")
    return facts.add(stated)


def _leave_out(
    graph: Graph, edges: Edges, facts: Facts, faults: list[str]
) -> tuple[dict[str, str], dict[tuple[str, str], str]]:
    """Find the passes that are not needed where `facts` hold, that others replace, and that cannot run without these.

    Returns the reason for each, and that for each (pass, port) that is not needed.
    """
    unneeded: dict[str, str] = {}
    ports = {(n.name, port): why for n in graph.nodes.values() for port, why in n.work.unneeded_outputs(facts).items()}
    for node in graph.nodes.values():
        try:
            if why := node.work.unneeded(facts):
                unneeded[node.name] = why
        except GraphError as error:
            faults.append(f"{node.name}: {error}")
    wires = [(name, port, source) for name, ports in edges.items() for port, source in ports.items() if source]

    for name, port, origin in wires:
        if origin in ports and not graph.nodes[name].work.inputs[port].optional:
            unneeded.setdefault(name, f"its input {port} is not needed: {ports[origin]}")

    def spread() -> None:
        known = -1
        while known < len(unneeded):
            known = len(unneeded)
            for name, port, (source, _) in wires:
                if source in unneeded and not graph.nodes[name].work.inputs[port].optional:
                    unneeded.setdefault(name, f"its input {port} comes from {source}, which is left out")

    spread()
    for name, port, (source, _) in wires:
        if source not in unneeded and graph.nodes[name].work.inputs[port].replaces:
            unneeded.setdefault(name, f"not needed: {source} replaces it")
    spread()
    for name, port, origin in wires:
        if origin[0] in unneeded or origin in ports:
            edges[name][port] = None
    return unneeded, ports


def _reach(roots: Roots, edges: Edges, unneeded: Mapping[str, str]) -> set[str]:
    """Walk back from the requested outputs. Returns every pass that one of them needs."""
    reached: set[str] = set()
    stack = [name for name, _ in roots.values()]
    while stack:
        name = stack.pop()
        if name not in reached and name not in unneeded:
            reached.add(name)
            stack.extend(source[0] for source in edges[name].values() if source)
    return reached


def _order(edges: Edges, reached: set[str], faults: list[str]) -> list[str]:
    """Sort writers before readers; the same file always gives the same order."""
    ahead = {name: [source[0] for source in edges[name].values() if source] for name in edges if name in reached}
    while True:
        try:
            return list(TopologicalSorter(ahead).static_order())
        except CycleError as error:
            cycle = error.args[1]
            faults.append("cycle: " + " -> ".join(cycle) + "; remove one of these inputs")
            ahead = {name: sources for name, sources in ahead.items() if name not in cycle}


def _describe(
    graph: Graph, edges: Edges, order: list[str], known: tuple[Facts, Collection[str] | None], faults: list[str]
) -> tuple[Step, ...]:
    """Ask each pass what it writes, given what it reads, and check that both ends of each wire agree.

    known: facts, and the names that `Pass.depends` may give.
    """
    facts, parts = known
    steps: dict[str, Step] = {}
    for name in order:
        work, descriptions = graph.nodes[name].work, dict[str, Description | None]()
        wires = {port: source for port, source in edges[name].items() if source}
        required = {port for port, declared in work.inputs.items() if not declared.optional}
        for port, (source, written) in wires.items():
            if source not in steps:
                continue  # at fault already; what it would write is unknown
            outputs = steps[source].outputs
            if written not in outputs:
                faults.append(f"{name}.{port}: {source} has no output '{written}'{did_you_mean(written, outputs)}")
                continue
            found, wanted = outputs[written].description, work.inputs[port].format
            if wanted in (None, found.format):
                descriptions[port] = found
            else:
                faults.append(f"{name}.{port} wants {wanted}, but {source}.{written} is {found.format}")
        if descriptions.keys() >= wires.keys() | required:
            described = dict.fromkeys(work.inputs) | descriptions
            try:
                step = Step(name, work, edges[name], work.outputs_for(facts, described), described)
            except GraphError as error:
                faults.append(f"{name}: {error}")
                continue
            steps[name] = step
            named = work.depends()
            if parts is not None and named is not None:
                unknown = sorted(named - set(parts))
                faults.extend(
                    f"{name}: depends(): no part of a frame is '{x}'{did_you_mean(x, parts)}" for x in unknown
                )
            faults.extend(
                f"{name}.{port}: shaders store into no {o.description}; declare one colour texture, such as rgba32f"
                for port, o in step.outputs.items()
                if o.image and not is_storable(o.description)
            )
            both = sorted(step.outputs.keys() & work.inputs.keys())
            faults.extend(f"{name}.{port}: is an input and an output; rename one of them" for port in both)
    for name, text in graph.outputs.items():
        source_name, _, port = text.partition(".")
        if source_name in steps and port not in steps[source_name].outputs:
            hint = did_you_mean(port, steps[source_name].outputs)
            faults.append(f"outputs.{name}: {source_name} has no output '{port}'{hint}")
    return tuple(steps.values())


def _drop(step: Step, ports: Collection[str]) -> Step:
    """Return a step without some of its outputs."""
    return replace(step, outputs={port: output for port, output in step.outputs.items() if port not in ports})


def _drop_spare(steps: tuple[Step, ...], roots: Roots) -> tuple[tuple[Step, ...], dict[str, str]]:
    """Drop the outputs that nobody reads and their passes can do without. Returns the steps, and each reason."""
    read = {source for step in steps for source in step.sources.values() if source} | set(roots.values())
    spare = {(s.name, port) for s in steps for port, output in s.outputs.items() if output.spare} - read
    slim = tuple(_drop(step, {port for name, port in spare if name == step.name}) for step in steps)
    return slim, {f"{name}.{port}": "nothing reads it" for name, port in sorted(spare)}


def _lifetimes(steps: tuple[Step, ...], roots: Roots) -> dict[tuple[str, str], tuple[int, int]]:
    """Find first writer and last reader of each resource, as indices of steps; requested outputs live to the end."""
    spans = {(step.name, port): (i, i) for i, step in enumerate(steps) for port in step.outputs}
    for i, step in enumerate(steps):
        for source in step.sources.values():
            if source:
                spans[source] = (spans[source][0], i)
    return spans | {root: (spans[root][0], len(steps) - 1) for root in roots.values()}
