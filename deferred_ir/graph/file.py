"""Read graph files: TOML to a Graph, with `extends`, and `--set` on top. Files never import code.

A pass's type is the name of its module in `passes/`, or of a class that the caller hands over.
"""

from __future__ import annotations

import copy
import hashlib
import importlib
import json
import os
import pkgutil
import tomllib
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

from deferred_ir.base.errors import GraphError, did_you_mean, format_value
from deferred_ir.base.toml_tables import read_toml
from deferred_ir.graph import former_names, params
from deferred_ir.graph.figures import Figure
from deferred_ir.graph.graph import Graph, Node
from deferred_ir.graph.pass_base import Pass

PASSES = "deferred_ir.passes"
GRAPHS = "deferred_ir.passes.graphs"
RESERVED = ("type", "inputs")


def graph_names() -> list[str]:
    """Return the names of the built-in graphs."""
    return sorted(path.stem for path in _graphs_folder().glob("*.toml"))


def find_obstacles() -> dict[str, str]:
    """Return why built-in graphs cannot run on this machine, and the mend, by the names of those that cannot."""
    found = {name: load_graph(name).find_obstacle() for name in graph_names()}
    return {name: obstacle for name, obstacle in found.items() if obstacle}


def load_graph(
    name: str | Path,
    settings: Mapping[str, Any] | None = None,
    passes: Mapping[str, type[Pass]] | None = None,
) -> Graph:
    """Load the graph `name` (a built-in name or a path), with `settings` {"pass.param": value} laid over it.

    `passes` are the caller's own pass classes by type name. Raises one GraphError that lists all faults of the file.
    """
    path = _find(str(name), None)
    passes = passes or {}
    table = _read(path, (), passes)
    faults: list[str] = []
    tables = table.get("passes", {})
    _apply(tables, settings or {}, passes, faults)
    nodes = {n: node for n, t in tables.items() if (node := _node(n, t, passes, faults))}
    outputs = table.get("outputs", {})
    if not isinstance(outputs, dict) or not all(isinstance(source, str) for source in outputs.values()):
        faults.append('outputs: wants name = "pass.port" lines')
    elif not outputs:
        faults.append('outputs: none; add a table [outputs] with radiance = "pass.port"')
    faults += [f"{key}: no such key{did_you_mean(key, KEYS)}" for key in table if key not in KEYS]
    if faults:
        text = " ".join("; ".join(faults).split())  # a key may hold a line break
        raise GraphError(f"{path.name}: {text}")
    return Graph(nodes, outputs, path.name)


KEYS = ("extends", "outputs", "passes")


def graph_files(name: str | Path) -> list[Path]:
    """Return the file of the graph `name` and the files that it extends, up to the first that cannot be read."""
    found: list[Path] = []
    try:
        path: Path | None = _find(str(name), None)
        while path and path not in found:
            found.append(path)
            base = tomllib.loads(path.read_text(encoding="utf-8")).get("extends")
            path = _find(base, path.parent) if isinstance(base, str) else None
    except (GraphError, OSError, ValueError):  # whoever loads the graph says what is wrong
        return found
    return found


def graph_hash(graph: Graph) -> str:
    """Return the first 16 hex digits of SHA-256 over the wiring and all parameters."""
    nodes = {n.name: [type(n.work).__name__, repr(n.work.params), dict(n.inputs)] for n in graph.nodes.values()}
    text = json.dumps([nodes, dict(graph.outputs)], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def list_figures(graph: Graph) -> list[Figure]:
    """List the figures of the passes that come with the package and of the graph's own."""
    kinds = [importlib.import_module(f"{PASSES}.{kind}").PASS for kind in pass_types()]
    kinds += [node.work for node in graph.nodes.values()]
    return list(dict.fromkeys(figure for kind in kinds for figure in kind.figures))


@cache
def pass_types() -> tuple[str, ...]:
    """Return the names of the passes that come with the package."""
    names = sorted(m.name for m in pkgutil.iter_modules(importlib.import_module(PASSES).__path__) if not m.ispkg)
    return tuple(names)


def _graphs_folder() -> Path:
    return Path(importlib.import_module(GRAPHS).__path__[0])


def _find(name: str, beside: Path | None) -> Path:
    """Find a built-in graph by name, else a file (relative to the file that extends it)."""
    if name in graph_names():
        return _graphs_folder() / f"{name}.toml"
    path = Path(name) if beside is None else beside / name
    if os.path.isfile(path):  # unlike Path.is_file it does not raise for names that the system cannot have
        return path
    if path.suffix == ".toml":
        raise GraphError(f"{name}: no such graph file; built-in graphs: {', '.join(graph_names())}")
    raise GraphError(f"graph '{name}': no such graph{did_you_mean(name, graph_names())}")


def _read(path: Path, above: tuple[Path, ...], passes: Mapping[str, type[Pass]]) -> dict[str, Any]:
    """Read the file and lay its tables over those of the file that it extends."""
    if path.resolve() in above:
        raise GraphError(
            f"{path.name}: extends itself; remove 'extends' from one of: {', '.join(p.name for p in above)}"
        )
    table = read_toml(path, path.name, GraphError)
    if not isinstance(table.get("passes", {}), dict):
        raise GraphError(f"{path.name}: passes: wants a table [passes.NAME] for each pass")
    if "extends" not in table:
        return _with_new_names(path, table, {}, passes)
    if not isinstance(table["extends"], str):
        raise GraphError(f"{path.name}: extends: wants the name or path of a graph")
    base = _read(_find(table["extends"], path.parent), (*above, path.resolve()), passes)
    removed = [name for name, value in table.get("passes", {}).items() if value is False]
    for name in removed:
        if name not in base.get("passes", {}):
            known = base.get("passes", {})
            raise GraphError(f"{path.name}: passes.{name}: nothing to remove{did_you_mean(name, known)}")
        del base["passes"][name], table["passes"][name]
        _unwire(base["passes"], name)
    _unwire_other_types(base.get("passes", {}), table.get("passes", {}), passes)
    table = _with_new_names(path, table, base, passes)
    return _cut(_overlay(base, {key: value for key, value in table.items() if key != "extends"}))


def _unwire(tables: Mapping[str, Any], removed: str) -> None:
    """Cut the inputs of passes that are wired to the pass `removed`."""
    for entry in tables.values():
        wires = entry.get("inputs") if isinstance(entry, dict) else None
        if isinstance(wires, dict):
            for port in [port for port, source in wires.items() if str(source).partition(".")[0] == removed]:
                del wires[port]


def _unwire_other_types(base: Mapping[str, Any], top: Mapping[str, Any], passes: Mapping[str, type[Pass]]) -> None:
    """Where `top` gives a pass another type, cut the inputs that it has in `base` and the new type does not know."""
    for name, entry in top.items():
        below, kind = base.get(name), entry.get("type") if isinstance(entry, dict) else None
        found = _pass(kind, passes) if isinstance(kind, str) else None
        if found and isinstance(below, dict) and isinstance(below.get("inputs"), dict):
            below["inputs"] = {port: source for port, source in below["inputs"].items() if port in found.inputs}


def _with_new_names(
    path: Path, table: dict[str, Any], base: Mapping[str, Any], passes: Mapping[str, type[Pass]]
) -> dict[str, Any]:
    """Return `table`, to be laid over `base`, with parameters that have moved to other passes set there."""
    own = {name: entry for name, entry in table.get("passes", {}).items() if isinstance(entry, dict)}
    values = {(name, key): value for name, entry in own.items() for key, value in entry.items() if key not in RESERVED}
    faults: list[str] = []
    tables = _overlay(base.get("passes", {}), own)
    renamed = former_names.rename(values, _kinds(tables), lambda kind: _params(kind, passes), faults)
    if faults:
        raise GraphError(f"{path.name}: {' '.join('; '.join(faults).split())}")
    if renamed == values:
        return table
    fixed = {name: {k: v for k, v in entry.items() if (name, k) not in values} for name, entry in own.items()}
    for (name, key), value in renamed.items():
        fixed.setdefault(name, {})[key] = value
    return {**table, "passes": {**table["passes"], **fixed}}


def _kinds(tables: Mapping[str, Any]) -> dict[str, str]:
    """Return the type of pass of each node whose table names a possible one."""
    kinds = {name: entry.get("type", name) for name, entry in tables.items() if isinstance(entry, dict)}
    return {name: kind for name, kind in kinds.items() if isinstance(kind, str)}


def _overlay(base: dict[str, Any], top: Mapping[str, Any]) -> dict[str, Any]:
    """Lay `top` over `base`, table by table. Returns a new table."""
    result = copy.deepcopy(base)
    for key, value in top.items():
        both = isinstance(value, dict) and isinstance(result.get(key), dict)
        result[key] = _overlay(result[key], value) if both else copy.deepcopy(value)
    return result


def _cut(table: dict[str, Any]) -> dict[str, Any]:
    """Remove the inputs and outputs that an extending file has set to false. Returns `table`."""
    wirings = [table.get("outputs")]
    wirings += [entry.get("inputs") for entry in table.get("passes", {}).values() if isinstance(entry, dict)]
    for wires in wirings:
        if isinstance(wires, dict):
            for port in [port for port, source in wires.items() if source is False]:
                del wires[port]
    return table


def _apply(
    tables: dict[str, Any], settings: Mapping[str, Any], passes: Mapping[str, type[Pass]], faults: list[str]
) -> None:
    """Lay `pass.param` settings over the tables of the passes."""
    values = {}
    for key, value in settings.items():
        node, dot, name = key.partition(".")
        if not dot or name in RESERVED:
            faults.append(f"set {key}: wants pass.param = value")
        else:
            values[node, name] = value
    contradictions: list[str] = []
    values = former_names.rename(values, _kinds(tables), lambda kind: _params(kind, passes), contradictions)
    faults += [f"set {fault}" for fault in contradictions]
    for (node, name), value in values.items():
        if isinstance(tables.get(node), dict):
            tables[node][name] = value
        else:
            faults.append(f"set {node}.{name}: no pass '{node}' in this graph{did_you_mean(node, tables)}")


def _pass(kind: str, passes: Mapping[str, type[Pass]]) -> type[Pass] | None:
    """Return the class of passes of type `kind`, the caller's own first, or None."""
    if kind in passes:
        return passes[kind]
    if kind not in pass_types():
        return None
    found: type[Pass] = importlib.import_module(f"{PASSES}.{kind}").PASS
    return found


def _params(kind: str, passes: Mapping[str, type[Pass]]) -> type | None:
    found = _pass(kind, passes)
    return None if found is None else found.Params


def _node(name: str, table: Any, passes: Mapping[str, type[Pass]], faults: list[str]) -> Node | None:
    if not isinstance(table, dict):
        faults.append(f"passes.{name}: wants a table of parameters and inputs")
        return None
    kind, inputs = table.get("type", name), table.get("inputs", {})
    if not isinstance(kind, str):
        faults.append(f"passes.{name}.type: is {format_value(kind)}, but wants the name of a pass type in quotes")
        return None
    if not isinstance(inputs, dict) or not all(isinstance(source, str) for source in inputs.values()):
        faults.append(f'passes.{name}.inputs: wants {{ port = "pass.port" }}')
        return None
    work = _pass(kind, passes)
    if work is None:
        faults.append(f"passes.{name}: no pass type '{kind}'{did_you_mean(kind, [*pass_types(), *passes])}")
        return None
    values = {key: value for key, value in table.items() if key not in RESERVED}
    return Node(name, work(params.parse(work.Params, values, name, faults)), inputs)
