"""What a frame costs on this machine with the settings of each rung of the ladder, kept in the user's cache folder."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from datetime import date
from pathlib import Path

from deferred_ir.tuning import cache
from deferred_ir.tuning.ladder import GRAPH, RUNGS

KIND = "costs"
SIZES = (96, 288)
"""Sides of the images that are measured, pixels: two tell what is paid for each frame and what for each pixel."""


@dataclass(frozen=True)
class MachineCosts:
    """Milliseconds of a frame of the built-in scene `cornell` with each rung: at each of SIZES, in the order of RUNGS.

    machine: what they hold for. measured: the day.
    """

    machine: str
    ms: Sequence[Sequence[float]]
    measured: str

    def predict(self, number: int, pixels: int) -> float:
        """Return what a frame of so many pixels costs with a rung, in proportion to pixels between the two sizes."""
        few, many = (side**2 for side in SIZES)
        small, large = self.ms[number]
        slope = max(large - small, 0.0) / (many - few)
        return float(max(small + slope * (pixels - few), 0.1 * small))


def describe_machine(device: str, opengl: str) -> str:
    """Name what costs depend on: the machine as in `name_machine`, and the ladder."""
    ladder = hashlib.sha256(repr((GRAPH, RUNGS, SIZES)).encode()).hexdigest()[:8]
    return f"{cache.name_machine(device, opengl)}, ladder {ladder}"


def find_file(machine: str) -> Path:
    """Return where the costs of a machine are kept."""
    return cache.find_file(KIND, machine)


def read(machine: str) -> MachineCosts | None:
    """Read the costs of a machine; None where they are not known, or the file is damaged."""
    try:
        costs = MachineCosts(**json.loads(find_file(machine).read_text(encoding="utf-8")))
        times = [[float(ms) for ms in row] for row in costs.ms]
    except (OSError, ValueError, TypeError):
        return None
    if costs.machine != machine or [len(row) for row in times] != [len(SIZES)] * len(RUNGS):
        return None
    return MachineCosts(machine, times, costs.measured)


def keep(machine: str, ms: Sequence[Sequence[float]]) -> MachineCosts:
    """Write costs that were measured just now. Where they cannot be written they are good for this process only."""
    costs = MachineCosts(machine, ms, date.today().isoformat())
    cache.keep(find_file(machine), asdict(costs))
    return costs
