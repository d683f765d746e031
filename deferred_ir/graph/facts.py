"""Facts: what planning may know of scene, settings and device, to leave passes out. Later rooms declare them.

A fact is a constant, declared once beside what it is about (`EMITS` in frame/facts.py), and asked for by that constant:
so a misspelt one is an error wherever it stands.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from deferred_ir.base.errors import GraphError

T = TypeVar("T")


@dataclass(frozen=True)
class Fact(Generic[T]):
    """One thing that planning may know. `unknown`: its value where nothing states it, with which no pass is missing.

    needs: it says what passes a scene needs; where everything is to be kept (`keep_all`) it counts as unknown.
    """

    name: str
    unknown: T
    doc: str
    needs: bool = False


Statements = Mapping[Fact[Any], Any]


class Facts:
    """Stated facts, immutable: `facts[EMITS]` is a fact's value, or its `unknown` if nothing states it."""

    def __init__(self, stated: Statements | None = None) -> None:
        self._stated = dict(stated or {})

    def __getitem__(self, fact: Fact[T]) -> T:
        """Return the value of `fact`. Raises GraphError for anything that is no Fact."""
        if not isinstance(fact, Fact):
            raise GraphError(f"facts[{fact!r}]: is no Fact; ask by the constant that declares it, such as EMITS")
        value: T = self._stated.get(fact, fact.unknown)
        return value

    def add(self, stated: Statements) -> Facts:
        """Return these facts and `stated` ones, which win."""
        return Facts({**self._stated, **stated})

    def forget_needs(self) -> Facts:
        """Return these facts without those that tell what passes are needed."""
        return Facts({fact: value for fact, value in self._stated.items() if not fact.needs})

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Facts) and self._stated == other._stated

    def __hash__(self) -> int:
        return hash(frozenset(self._stated.items()))

    def __repr__(self) -> str:
        return f"Facts({', '.join(f'{fact.name}={value!r}' for fact, value in self._stated.items())})"


NOTHING_KNOWN = Facts()
"""With these facts no pass is left out for what a scene does not need."""
