"""Fields of lights: how their values are checked, alike in files and in Python, and how lights with a place move."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import fields, replace
from functools import cached_property
from typing import Any, Self

import numpy as np

from deferred_ir.base.arrays import Array, Vec3, add_vec3
from deferred_ir.base.errors import SceneError, format_value
from deferred_ir.scene.camera import find_view_fault

COLOURS = ("emission", "intensity", "irradiance", "radiance")
"""Fields that are linear RGB, whatever their unit."""
POINTS = ("position", "look_at", "up")

Fault = tuple[str, str]
"""The key of a field and what is wrong with its value."""


class LightError(SceneError):
    """A light's values cannot be used. faults: keys, and what is wrong with each."""

    def __init__(self, kind: str, faults: Sequence[Fault]) -> None:
        super().__init__("; ".join(f"{kind}.{key}: {what}" for key, what in faults))
        self.faults = tuple(faults)


class CheckedLight:
    """Checks the fields of a frozen dataclass when one is made: points and colours are three numbers, and so on.

    Subclasses add what else must hold in `find_faults`, which is called where every field has its type.
    """

    def __post_init__(self) -> None:
        """Raise LightError unless all values can be used; sequences of three become tuples of floats."""
        names = [field.name for field in fields(self)]  # type: ignore[arg-type]  # each subclass is a dataclass
        faults: list[Fault] = []
        for name in names:
            value = getattr(self, name)
            if name in POINTS or (name in COLOURS and value is not None):
                numbers = read_numbers(value, 3)
                if isinstance(numbers, str):
                    faults.append((name, numbers))
                    continue
                object.__setattr__(self, name, numbers)
                if name in COLOURS and min(numbers) < 0:
                    faults.append((name, f"must be 0 or more, not {format_value(list(numbers))}"))
        if not faults:
            faults = list(self.find_faults())
        if faults:
            raise LightError(type(self).__name__, faults)

    def find_faults(self) -> Iterator[Fault]:
        """Yield what is wrong with the values."""
        yield from ()

    def find_number_faults(
        self, key: str, low: float, high: float = math.inf, unit: str = "", *, open_ends: bool = False
    ) -> Iterator[Fault]:
        """Yield a fault unless the number `key` is finite and lies between `low` and `high`, or strictly between."""
        value = getattr(self, key)
        if isinstance(value, bool) or not isinstance(value, int | float | np.floating | np.integer):
            yield key, f"must be a number, not {format_value(value)}"
        elif not math.isfinite(value):
            yield key, f"must be finite, not {value}"
        elif not (low < value < high if open_ends else low <= value <= high):
            yield key, f"must {_describe_range(low, high, open_ends)}{unit}, not {float(value)}"
        else:
            object.__setattr__(self, key, float(value))


class PlacedLight(CheckedLight):
    """A light with a `position` and a `motion`, and perhaps a `look_at`."""

    position: Vec3
    look_at: Vec3
    motion: Any

    def find_faults(self) -> Iterator[Fault]:
        """Yield a fault if it looks nowhere."""
        look_at = getattr(self, "look_at", None)
        # Around the middle of a Lissajous figure the light may well look at that.
        fault = look_at and self.motion is None and find_view_fault(self.position, look_at, getattr(self, "up", None))
        if fault:
            yield fault

    @cached_property
    def axis(self) -> Array:
        """Unit direction in which it looks, for lights with a `look_at`, float64 (3,)."""
        axis = np.subtract(self.look_at, self.position).astype(np.float64)
        unit: Array = axis / np.linalg.norm(axis)
        return unit

    def at(self, time: float) -> Self:
        """Return the light where it is at `time` seconds of its motion, at rest there."""
        if self.motion is None:
            return self
        look_at = getattr(self, "look_at", self.position)
        position, look_at = self.motion.move(self.position, look_at, time)
        return self._place(position, look_at)

    def translate(self, by: Vec3) -> Self:
        """Return the light moved by a vector, at rest there."""
        return self._place(add_vec3(self.position, by), add_vec3(getattr(self, "look_at", self.position), by))

    def _place(self, position: Vec3, look_at: Vec3) -> Self:
        aim = {"look_at": look_at} if hasattr(self, "look_at") else {}
        placed: Self = replace(self, position=position, motion=None, **aim)  # type: ignore[type-var]
        return placed


def read_numbers(value: Any, length: int) -> Any:
    """Return `length` finite numbers of a sequence as a tuple of floats, or say what is wrong with it."""
    wanted = f"must be {length} numbers such as [{', '.join(['1.0'] * length)}]"
    try:
        numbers = tuple(float(item) for item in value)
    except (TypeError, ValueError):
        return f"{wanted}, not {format_value(value)}"
    if len(numbers) != length or isinstance(value, str):
        return f"{wanted}, not {format_value(value)}"
    if not all(map(math.isfinite, numbers)):
        return f"must be finite, not {format_value(list(numbers))}"
    return numbers


def _describe_range(low: float, high: float, open_ends: bool) -> str:
    if math.isinf(high):
        return f"be above {low:g}" if open_ends else f"be {low:g} or more"
    return f"lie between {low:g} and {high:g}"
