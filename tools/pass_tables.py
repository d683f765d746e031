"""Writes the tables of passes into docs/graph.md: `python tools/pass_tables.py`.

Ports and parameters are stated once, in the passes; the page repeats them between two markers. A test checks
that it is up to date. What a pass writes may depend on its inputs; the tables show built-in graphs at their defaults.
"""

from __future__ import annotations

import importlib
import sys
from collections.abc import Mapping
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from pages import ROOT, replace_between

from deferred_ir.graph import file
from deferred_ir.graph.compile import compile
from deferred_ir.graph.graph import Step
from deferred_ir.graph.params import specs
from deferred_ir.graph.pass_base import Pass
from deferred_ir.graph.ports import Output

PAGE = ROOT / "docs" / "graph.md"
BEGIN = "<!-- passes: written by tools/pass_tables.py -->"
END = "<!-- end of passes -->"


def steps() -> dict[str, Step]:
    """Return for each type of pass a step of a built-in graph that uses it."""
    result = {}
    by_rays: Mapping[str, Mapping[str, str]] = {"mapped": {"shadow_rays.visibility": "rays"}}  # uses more passes
    for name in sorted(file.graph_names(), key=lambda name: name != "deferred"):
        graph = file.load_graph(name, by_rays.get(name, {}), {})
        for step in compile(graph, list(graph.outputs)).steps:
            kind = type(step.work).__module__.rpartition(".")[2]
            result.setdefault(kind, step)
    return result


def table(head: tuple[str, ...], rows: list[tuple[str, ...]]) -> list[str]:
    """Return the lines of a Markdown table, and an empty one."""
    lines = [head, ("---",) * len(head), *rows]
    return [*("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines), ""]


def section(kind: str, work: Pass, outputs: Mapping[str, Output]) -> list[str]:
    """Return the lines on one type of pass: heading, ports and parameters."""
    summary = (type(work).__doc__ or "").strip().splitlines()[0]
    ports = []
    for port, declared in work.inputs.items():
        how = [declared.format or "any"]
        how += ["optional"] * declared.optional + ["attached"] * declared.attach
        ports.append(("reads", f"`{port}`", ", ".join(how), declared.doc))
    ports += [("writes", f"`{port}`", str(output.description), output.doc) for port, output in outputs.items()]
    lines = [f"### {kind}", "", summary, "", *table(("", "port", "format", ""), ports)]
    parameters = [
        (f"`{spec.name}`", f"`{spec.default}`", spec.wants(), spec.doc) for spec in specs(type(work.params)).values()
    ]
    return lines + (table(("parameter", "default", "takes", ""), parameters) if parameters else [])


def tables() -> str:
    """Return the text between the markers. Outputs are left out for passes that no built-in graph has."""
    shown, lines = steps(), list[str]()
    for kind in file.pass_types():
        step = shown.get(kind)
        work = step.work if step else importlib.import_module(f"{file.PASSES}.{kind}").PASS()
        lines += section(kind, work, step.outputs if step else {})
    return "\n".join(lines)


def update(page: str) -> str:
    """Return the page with up-to-date tables."""
    return replace_between(page, BEGIN, END, tables())


if __name__ == "__main__":
    PAGE.write_text(update(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
