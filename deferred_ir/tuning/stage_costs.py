"""Keeps in the user's cache folder which passes run faster in compute shaders on this machine.

An image must not depend on what was measured, so that only passes count that have given the same bits either way.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from datetime import date
from pathlib import Path

from deferred_ir.tuning import cache

KIND = "stages"
GAIN = 0.9
"""Compute shaders count as faster that take less than this fraction of the time: two measurements differ by as much."""


@dataclass(frozen=True)
class Trial:
    """What a pass costs in fragment and in compute shaders, milliseconds. equal: whether both gave the same bits."""

    fragment_ms: float
    compute_ms: float
    equal: bool

    @property
    def computed(self) -> bool:
        """Whether the pass runs in compute shaders unless it is told otherwise."""
        return self.equal and self.compute_ms < GAIN * self.fragment_ms

    def __str__(self) -> str:
        why = "used" if self.computed else "not faster" if self.equal else "other pixels"
        return f"{self.fragment_ms:.2f} ms, computed {self.compute_ms:.2f} ms, {why}"


@dataclass(frozen=True)
class StageCosts:
    """The trials of a machine's passes, by the pass's module. measured: the day."""

    machine: str
    passes: Mapping[str, Trial]
    measured: str


def find_file(machine: str) -> Path:
    """Return where the trials of a machine, named as by `name_machine`, are kept."""
    return cache.find_file(KIND, machine)


def read(machine: str) -> StageCosts | None:
    """Read the trials of a machine; None where there are none, or the file is damaged."""
    try:
        record = json.loads(find_file(machine).read_text(encoding="utf-8"))
        trials = {
            str(kind): Trial(float(trial["fragment_ms"]), float(trial["compute_ms"]), trial["equal"] is True)
            for kind, trial in record["passes"].items()
        }
        costs = StageCosts(record["machine"], trials, str(record["measured"]))
    except (OSError, ValueError, TypeError, KeyError, AttributeError):
        return None
    return costs if costs.machine == machine else None


def keep(machine: str, passes: Mapping[str, Trial]) -> StageCosts:
    """Write trials that were made just now. Where they cannot be written they are good for this process only."""
    costs = StageCosts(machine, passes, date.today().isoformat())
    cache.keep(find_file(machine), asdict(costs))
    return costs


def list_computed(machine: str) -> frozenset[str]:
    """Return the modules of the passes that run in compute shaders on a machine unless they are told otherwise."""
    costs = read(machine)
    return frozenset() if costs is None else frozenset(kind for kind, t in costs.passes.items() if t.computed)
