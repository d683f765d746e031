"""Which passes a frame can leave as they are: those that would write what they wrote last.

A pass's outputs are made of its parameters, its inputs and the parts of the frame that it names (`Pass.depends`).
Inputs are told by the version that each resource has: a new one whenever something is written into it.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import Any

from deferred_ir.frame.frame import Frame
from deferred_ir.frame.pass_io import Io, Resource
from deferred_ir.graph.graph import Step


@dataclass(frozen=True)
class _Run:
    made_of: tuple[Any, ...]
    outputs: list[int]
    figures: Counter[str]


class Runs:
    """The last run of each step, by name."""

    def __init__(self) -> None:
        self._runs: dict[str, _Run] = {}

    def figures(self, step: Step, io: Io, frame: Frame) -> Counter[str] | None:
        """The figures that still hold, if the step would write what its outputs hold already; else None."""
        run = self._runs.get(step.name)
        if run and run.outputs == _versions(io, step.outputs) and run.made_of == _made_of(step, io, frame):
            return run.figures
        return None

    def forget(self, step: Step) -> None:
        """Its outputs are being written."""
        self._runs.pop(step.name, None)

    def remember(self, step: Step, io: Io, frame: Frame) -> None:
        """Its outputs are written."""
        if not io.again:
            self._runs[step.name] = _Run(_made_of(step, io, frame), _versions(io, step.outputs), Counter(io.figures))

    def clear(self) -> None:
        """Every step is to run."""
        self._runs.clear()


def _made_of(step: Step, io: Io, frame: Frame) -> tuple[Any, ...]:
    """What the outputs of a step follow from; two are equal only if the outputs are."""
    return (
        type(step.work),
        step.work.params,
        tuple(io.defines.items()),
        tuple(io.metas.items()),
        _versions(io, step.work.inputs),
        frame.read_parts(step.work.depends()),
        frame.by_view,
    )


def _versions(io: Io, ports: Any) -> list[int]:
    resources: list[Resource | None] = [io[port] for port in ports]
    return [
        single.version for found in resources if found for single in (found if isinstance(found, list) else [found])
    ]
