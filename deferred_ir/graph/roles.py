"""Roles: what a parameter is for those who know no pass by name, such as `vpls`, the number of VPLs.

A parameter declares its role, `param(..., role="vpls")`. Options of commands and the keys of scene files set all
parameters of the graph that have it.
"""

from __future__ import annotations

from dataclasses import fields
from typing import Any

from deferred_ir.graph.graph import Graph
from deferred_ir.graph.pass_base import Pass


def find_parameter(work: Pass, role: str) -> str | None:
    """Return the name of the pass's parameter with this role, or None."""
    return next((field.name for field in fields(work.Params) if field.metadata.get("role") == role), None)


def find_parameters(graph: Graph, role: str) -> dict[str, Any]:
    """Return {"pass.param": value} of all parameters of the graph with this role."""
    found = {}
    for node in graph.nodes.values():
        if name := find_parameter(node.work, role):
            found[f"{node.name}.{name}"] = getattr(node.work.params, name)
    return found
