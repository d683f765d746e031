"""Decides which passes a frame can skip: a pass is skipped while its outputs hold what it would write.

They follow from its parameters, its inputs and the parts of the frame that it names (`Pass.depends`). Inputs are
compared by the version of each resource, which is a new one whenever something is written into it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from deferred_ir.frame.frame import Frame
from deferred_ir.frame.pass_io import Io, single_resources
from deferred_ir.graph.graph import Step


@dataclass(frozen=True)
class _Run:
    causes: tuple[Any, ...]
    outputs: list[int]
    figures: Counter[str]


class Runs:
    """The last run of each step, by name."""

    def __init__(self) -> None:
        self._runs: dict[str, _Run] = {}

    def figures(self, step: Step, io: Io, frame: Frame) -> Counter[str] | None:
        """Return the figures of its last run, which still hold, if the step can be skipped; else None."""
        run = self._runs.get(step.name)
        if run and run.outputs == _versions(io, step.outputs) and run.causes == _causes(step, io, frame):
            return run.figures
        return None

    def forget(self, step: Step) -> None:
        """Note that its outputs are being written."""
        self._runs.pop(step.name, None)

    def remember(self, step: Step, io: Io, frame: Frame) -> None:
        """Note that its outputs are written."""
        if not io.again:
            self._runs[step.name] = _Run(_causes(step, io, frame), _versions(io, step.outputs), Counter(io.figures))

    def clear(self) -> None:
        """Have every step run."""
        self._runs.clear()


def _causes(step: Step, io: Io, frame: Frame) -> tuple[Any, ...]:
    """Return what the outputs of a step follow from: if two runs' are equal, so are the outputs."""
    return (
        type(step.work),
        step.work.params,
        tuple(io.defines.items()),
        tuple(io.metas.items()),
        _versions(io, step.work.inputs),
        frame.read_parts(step.work.depends()),
        frame.by_view,
    )


def _versions(io: Io, ports: Iterable[str]) -> list[int]:
    return [single.version for port in ports for single in single_resources(io[port])]
