"""What a frame costs on this machine with the settings of each rung of the ladder, kept in the user's cache folder."""

from __future__ import annotations

import hashlib
import json
import logging
import os
import platform
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from datetime import date
from importlib import metadata
from pathlib import Path

from deferred_ir.base.errors import OutputError
from deferred_ir.base.files import write_json
from deferred_ir.tuning.ladder import GRAPH, RUNGS

log = logging.getLogger("deferred_ir")

DISTRIBUTION = "deferred-ir"
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


def describe_machine(driver: str) -> str:
    """Name what costs depend on: processor, driver, version of the package, and the ladder."""
    ladder = hashlib.sha256(repr((GRAPH, RUNGS, SIZES)).encode()).hexdigest()[:8]
    version = metadata.version(DISTRIBUTION)
    return f"{_name_processor()}, {os.cpu_count()} cores; {driver}; {DISTRIBUTION} {version}, ladder {ladder}"


def _name_processor() -> str:
    info = Path("/proc/cpuinfo")
    lines = info.read_text().splitlines() if info.exists() else []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()


def find_file(machine: str) -> Path:
    """Return where the costs of a machine are kept."""
    import platformdirs

    name = hashlib.sha256(machine.encode()).hexdigest()[:12]
    return Path(platformdirs.user_cache_dir(DISTRIBUTION, appauthor=False)) / f"costs-{name}.json"


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
    file = find_file(machine)
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        write_json(file, asdict(costs))
    except (OSError, OutputError) as error:
        log.warning("the costs of this machine cannot be kept: %s", error)
    return costs
