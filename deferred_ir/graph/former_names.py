"""Parameters that have moved to another pass: their former names, `pass.param`, go on working, with a note.

A parameter declares its former name, `param(..., formerly="old_pass.old_param")`; the old pass is a type or the name of
a node. A value under the former name goes to every node of the graph that declares it.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from dataclasses import fields
from functools import cache
from typing import Any

log = logging.getLogger("deferred_ir")
Key = tuple[str, str]
"""A node's name and a parameter of it."""


def rename(
    values: Mapping[Key, Any], kinds: Mapping[str, str], params: Callable[[str], type | None], faults: list[str]
) -> dict[Key, Any]:
    """Return `values` under the names that parameters have now.

    kinds: type of pass of each node in the graph; params: the parameter dataclass of a type, None if there is none.
    Values that contradict each other are added to `faults`.
    """

    def own(node: str) -> dict[str, Any]:
        found = params(kinds[node]) if node in kinds else None
        return {} if found is None else {field.name: field.metadata for field in fields(found)}

    moved = [key for key in values if key[1] not in own(key[0])]
    if not moved:
        return dict(values)
    homes: dict[str, list[Key]] = {}
    for node in kinds:
        for name, metadata in own(node).items():
            homes.setdefault(metadata.get("formerly", ""), []).append((node, name))
    result = dict(values)
    for node, name in moved:
        former = (f"{node}.{name}", f"{kinds.get(node, node)}.{name}")
        value = values[node, name]
        found = next((homes[key] for key in former if key in homes), [])
        for home in found:
            result.pop((node, name), None)
            if result.setdefault(home, value) != value:
                faults.append(f"{node}.{name}: has moved to {'.'.join(home)}, which has another value; remove one")
        if found:
            _note(f"{node}.{name}", " and ".join(".".join(home) for home in found))
    return result


@cache
def _note(former: str, now: str) -> None:
    """Log, once a process, that a parameter has moved."""
    log.warning("%s has moved: write %s", former, now)
