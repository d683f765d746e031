"""Reads TOML files and checks their tables: each fault is noted with its key, and all are reported at once."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any, NoReturn

from deferred_ir.base.arrays import Vec3
from deferred_ir.base.errors import Error, SceneError, did_you_mean, format_value

LARGEST = 1e18
"""Larger numbers are refused: their squares would overflow 32-bit floats."""
MOST = 20
"""Most faults that one message lists."""
EXAMPLES = {2: "[0.0, 0.0]", 3: "[0.0, 0.0, 0.0]", 4: "[0, 0, 0, 1]"}
"""Example vectors for messages, by length. Four numbers are a quaternion, which must not be zero."""

DEEPEST = 32
"""Most levels of tables and arrays in a file; Python's own functions on nested values end at some hundreds."""


def read_toml(path: Path, name: str, error: type[Error]) -> dict[str, Any]:
    """Read a TOML file. Raises `error`, one line that begins with `name`, where there is no file or no TOML in it."""
    try:
        data = tomllib.loads(path.read_bytes().decode())
    except OSError as fault:
        raise error(f"{name}: cannot be read: {fault.strerror or fault}") from fault
    except (ValueError, RecursionError) as fault:  # bad TOML, bad UTF-8, nested beyond reason
        raise error(f"{name}: not a TOML file: {' '.join(str(fault).split())}") from fault
    if _is_too_deep(data):
        raise error(f"{name}: tables and arrays nested deeper than {DEEPEST}; flatten them")
    return data


def _is_too_deep(value: Any) -> bool:
    """Return whether tables and arrays in `value` are nested beyond DEEPEST."""
    level = [value]
    for _ in range(DEEPEST):
        tables = [item.values() for item in level if isinstance(item, dict)]
        level = [inner for items in [*tables, *(item for item in level if isinstance(item, list))] for inner in items]
    return bool(level)


class Faults:
    """The faults found in one file so far."""

    def __init__(self, file: str) -> None:
        self.file = file
        self.found: list[str] = []

    def add(self, key: str, what: str) -> None:
        """Note that `key` is wrong; `what` says how, and how to mend it."""
        self.found.append(f"{key}: {what}" if key else what)

    def fail(self) -> NoReturn:
        """Raise a SceneError with all faults in one line."""
        more = [f"and {len(self.found) - MOST} more"] if len(self.found) > MOST else []
        faults = " ".join("; ".join(self.found[:MOST] + more).split())  # a key may hold a line break
        raise SceneError(f"{self.file}: {faults}")


class Table:
    """One TOML table. Its methods check the value of a key and note a fault where it does not fit.

    After a fault they return None, or the default if there is one; `Faults.found` holds all that was noted.
    """

    def __init__(self, faults: Faults, name: str, data: Mapping[str, Any], known: tuple[str, ...]) -> None:
        self.faults, self.name, self.data = faults, name, data
        for key in data:
            if key not in known:
                # Finding the nearest key takes time, and no more than MOST faults are shown.
                hint = did_you_mean(key, known) if len(faults.found) < MOST else ""
                self.fault(key, f"unknown key{hint}")

    def fault(self, key: str, what: str) -> None:
        """Note a fault of `key`."""
        self.faults.add(f"{self.name}.{key}" if self.name else key, what)

    def _missing(self, key: str, needed: bool, mend: str = "") -> bool:
        """Return whether the table lacks `key`, and note a fault if it is needed. mend: what to give."""
        if key in self.data:
            return False
        if needed:
            self.fault(key, f"missing; give {mend}" if mend else "missing")
        return True

    def table(self, key: str, known: tuple[str, ...]) -> Table | None:
        """Return the table `key` within this one, if there is one."""
        if self._missing(key, needed=False):
            return None
        value = self.data[key]
        if not isinstance(value, dict):
            self.fault(key, f"must be a table, not {format_value(value)}")
            return None
        return Table(self.faults, f"{self.name}.{key}" if self.name else key, value, known)

    def string(self, key: str, needed: bool = False, mend: str = "") -> str | None:
        """Return a string that is not empty. mend: what to give where it is missing."""
        if self._missing(key, needed, mend):
            return None
        value = self.data[key]
        if not isinstance(value, str) or not value.strip():
            self.fault(key, f'must be a string such as "name", not {format_value(value)}')
            return None
        return value

    def boolean(self, key: str, *, default: bool) -> bool:
        """Return true or false."""
        value = self.data.get(key, default)
        if not isinstance(value, bool):
            self.fault(key, f"must be true or false, not {format_value(value)}")
            return default
        return value

    def integer(self, key: str) -> int | None:
        """Return an integer of 0 or more."""
        if self._missing(key, needed=False):
            return None
        value = self.data[key]
        if isinstance(value, bool) or not isinstance(value, int) or value < 0:
            self.fault(key, f"must be an integer of 0 or more, not {format_value(value)}")
            return None
        return value

    def number(self, key: str, default: float) -> float:
        """Return a finite number."""
        if self._missing(key, needed=False):
            return default
        value = check_number(self.data[key])
        if isinstance(value, str):
            self.fault(key, value)
            return default
        return value

    def vector(self, key: str, length: int = 3, needed: bool = True) -> tuple[float, ...] | None:
        """Return `length` finite numbers."""
        if self._missing(key, needed, f"{length} numbers such as {EXAMPLES[length]}"):
            return None
        value = check_vector(self.data[key], length)
        if isinstance(value, str):
            self.fault(key, value)
            return None
        return value

    def vec3(self, key: str, needed: bool = True) -> Vec3 | None:
        """Return three finite numbers."""
        value = self.vector(key, 3, needed)
        return None if value is None else (value[0], value[1], value[2])

    def times(self) -> tuple[float, ...] | None:
        """Return the array `times` of a motion: at least one finite number, ascending."""
        if self._missing("times", needed=True, mend="seconds such as [0, 2]"):
            return None
        raw = self.data["times"]
        times = check_vector(raw, len(raw) if isinstance(raw, list) else 1)
        if isinstance(times, str) and isinstance(raw, list):
            self.fault("times", times)
            return None
        if isinstance(times, str) or not times:
            self.fault("times", f"must be an array of numbers such as [0, 2], not {format_value(raw)}")
            return None
        if any(later <= earlier for earlier, later in pairwise(times)):
            self.fault("times", f"must be ascending, each later than the one before, not {format_value(raw)}")
            return None
        return times

    def vectors(self, key: str, length: int, times: tuple[float, ...] | None) -> list[tuple[float, ...]] | None:
        """Return an array of vectors, one for each of `times`."""
        if self._missing(key, needed=True, mend=f"one for each time, such as {EXAMPLES[length]}"):
            return None
        raw = self.data[key]
        if not isinstance(raw, list):
            self.fault(key, f"must be an array of arrays of {length} numbers, not {format_value(raw)}")
            return None
        if times is not None and len(raw) != len(times):
            self.fault(key, f"has {len(raw)} entries but times has {len(times)}; give one for each time")
            return None
        result = []
        for index, item in enumerate(raw):
            value = check_vector(item, length)
            if isinstance(value, str):
                self.fault(f"{key}[{index}]", value)
                return None
            result.append(value)
        return result

    def vec3s(self, key: str, times: tuple[float, ...] | None) -> tuple[Vec3, ...] | None:
        """Read the array of triples under `key`, one for each of `times`; None if it is missing or faulty."""
        rows = self.vectors(key, 3, times)
        return None if rows is None else tuple((x, y, z) for x, y, z in rows)


def check_number(value: Any) -> float | str:
    """Return `value` as a float, or say what is wrong with it."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return f"must be a number, not {format_value(value)}"
    if isinstance(value, float) and not math.isfinite(value):
        return f"must be finite, not {value}"
    if abs(value) > LARGEST:
        return f"{format_value(value)} is too large for 32-bit floats; keep to {LARGEST:g}"
    return float(value)


def check_vector(value: Any, length: int) -> tuple[float, ...] | str:
    """Return `value` as `length` floats, or say what is wrong with it."""
    if not isinstance(value, list) or len(value) != length:
        return f"must be {length} numbers such as {EXAMPLES[length]}, not {format_value(value)}"
    result = []
    for item in value:
        checked = check_number(item)
        if isinstance(checked, str):
            return checked
        result.append(checked)
    return tuple(result)
