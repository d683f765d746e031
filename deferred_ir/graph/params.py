"""Parameters of passes, each stated once: type, default, range and doc on a frozen dataclass.

The same data checks a graph file, parses `--set`, and feeds the docs and the viewer's widgets. Types: bool, int, float,
`Literal` of strings, and a number or such a `Literal`.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any, Literal, get_args, get_type_hints

from deferred_ir.base.errors import did_you_mean, format_value


def param(
    default: Any,
    *,
    doc: str,
    lo: float | None = None,
    hi: float | None = None,
    formerly: str | None = None,
    role: str | None = None,
) -> Any:
    """Declare a dataclass field that is a parameter: its default, its inclusive range and one sentence about it.

    formerly: its name when it was another pass's, `old_pass.old_param`, which is still accepted. role: what it is for
    those who do not know the pass (see graph/roles.py): "vpls" is what --vpls sets.
    """
    more = {name: value for name, value in (("formerly", formerly), ("role", role)) if value is not None}
    return field(default=default, metadata={"doc": doc, "lo": lo, "hi": hi, **more})


@dataclass(frozen=True)
class NoParams:
    """The parameters of a pass that has none."""


@dataclass(frozen=True)
class Spec:
    """One parameter as data, for files, sliders and the tables of the docs."""

    name: str
    default: Any
    doc: str
    number: type | None
    choices: tuple[str, ...]
    lo: float | None
    hi: float | None

    def wants(self) -> str:
        """Return in words what a value must be."""
        if self.number is bool:
            return "true or false"
        words = ["'" + "', '".join(self.choices) + "'"] if self.choices else []
        if self.number:
            span = [f"at least {self.lo:g}"] if self.lo is not None else []
            span += [f"at most {self.hi:g}"] if self.hi is not None else []
            kind = "a whole number" if self.number is int else "a number"
            words.append(" ".join([kind, " and ".join(span)]).strip())
        return " or ".join(words)

    def fault(self, value: Any) -> str | None:
        """Return what is wrong with `value`, or None."""
        if self._fits(value):
            return None
        hint = did_you_mean(value, self.choices) if isinstance(value, str) and not self.number else ""
        return f"is {format_value(value)}, but wants {self.wants()}" + (hint if "mean" in hint else "")

    def _fits(self, value: Any) -> bool:
        if isinstance(value, str):
            return value in self.choices
        if isinstance(value, bool) or self.number is bool:
            return isinstance(value, bool) and self.number is bool
        if self.number is None or not isinstance(value, int if self.number is int else (int, float)):
            return False
        if (self.lo is not None and value < self.lo) or (self.hi is not None and value > self.hi):
            return False
        try:
            return self.number is int or math.isfinite(value)
        except OverflowError:  # a whole number beyond all floats
            return False


def specs(params: type) -> dict[str, Spec]:
    """Return all parameters of a parameter dataclass, by name."""
    hints = get_type_hints(params)
    result = {}
    for f in fields(params):
        hint = hints[f.name]
        parts = [hint] if hint in (bool, int, float) or get_args(hint) == () else list(get_args(hint))
        if getattr(hint, "__origin__", None) is Literal:
            parts = [hint]
        number = next((part for part in parts if part in (bool, int, float)), None)
        choices = tuple(c for part in parts if part not in (bool, int, float) for c in get_args(part))
        meta = f.metadata
        result[f.name] = Spec(f.name, f.default, meta["doc"], number, choices, meta["lo"], meta["hi"])
    return result


def parse(params: type, table: Mapping[str, Any], where: str, faults: list[str]) -> Any:
    """Make an instance of the dataclass `params` from `table`; a fault goes to `faults`, its default stays."""
    known, values = specs(params), {}
    for name, value in table.items():
        if name not in known:
            faults.append(f"{where}.{name}: no such parameter{did_you_mean(name, known)}")
        elif fault := known[name].fault(value):
            faults.append(f"{where}.{name}: {fault}")
        else:
            values[name] = float(value) if known[name].number is float and not isinstance(value, str) else value
    return params(**values)


def read_value(text: str) -> Any:
    """Read the value of `--set pass.param=text`: a TOML value, else the bare text as a string."""
    try:
        table = tomllib.loads(f"value = {text}")
    except (ValueError, RecursionError):  # no TOML, or too long or too deeply nested for Python
        return text
    return table["value"] if len(table) == 1 else text
