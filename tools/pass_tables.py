"""Writes the tables of passes into docs/graph.md: `python tools/pass_tables.py`.

Ports and parameters are stated once, in the passes; the page repeats them between two markers. A test checks that it
is up to date. What a pass writes may depend on its inputs: shown are built-in graphs at their defaults.
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from pages import ROOT, between

from deferred_ir.frame.facts import TRIANGLES
from deferred_ir.graph import file
from deferred_ir.graph.compile import compile
from deferred_ir.graph.facts import Facts
from deferred_ir.graph.graph import Step
from deferred_ir.graph.params import specs

PAGE = ROOT / "docs" / "graph.md"
BEGIN = "<!-- passes: written by tools/pass_tables.py -->"
END = "<!-- end of passes -->"


def steps() -> dict[str, Step]:
    """For each type of pass, a step of a built-in graph that uses it."""
    found = {}
    large = Facts({TRIANGLES: 100_000})  # a scene in which no pass is left out
    for name in sorted(file.graph_names(), key=lambda name: name != "deferred"):
        graph = file.load_graph(name)
        for step in compile(graph, list(graph.outputs), large).steps:
            kind = type(step.work).__module__.rpartition(".")[2]
            found.setdefault(kind, step)
    return found


def table(head: tuple[str, ...], rows: list[tuple[str, ...]]) -> list[str]:
    """A Markdown table and an empty line."""
    lines = [head, ("---",) * len(head), *rows]
    return [*("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines), ""]


def section(kind: str, step: Step) -> list[str]:
    """Heading, ports and parameters of one type of pass."""
    summary = (type(step.work).__doc__ or "").strip().splitlines()[0]
    ports = []
    for port, declared in step.work.inputs.items():
        how = [declared.format or "any"]
        how += ["optional"] * declared.optional + ["attached"] * declared.attach
        ports.append(("reads", f"`{port}`", ", ".join(how), declared.doc))
    ports += [("writes", f"`{port}`", str(output.description), output.doc) for port, output in step.outputs.items()]
    lines = [f"### {kind}", "", summary, "", *table(("", "port", "format", ""), ports)]
    parameters = [
        (f"`{spec.name}`", f"`{spec.default}`", spec.wants(), spec.doc)
        for spec in specs(type(step.work.params)).values()
    ]
    return lines + (table(("parameter", "default", "takes", ""), parameters) if parameters else [])


def tables() -> str:
    """The whole section between the markers."""
    found = steps()
    missing = set(file.pass_types()) - found.keys()
    if missing:
        raise SystemExit(f"in no built-in graph, so not shown: {', '.join(sorted(missing))}")
    return "\n".join(line for kind in sorted(found) for line in section(kind, found[kind]))


def updated(page: str) -> str:
    """The page with its tables as they should be."""
    return between(page, BEGIN, END, tables())


if __name__ == "__main__":
    PAGE.write_text(updated(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
