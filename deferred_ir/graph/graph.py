"""Graphs and plans as data: passes wired by name, and what a compiled graph runs.

A graph wires ports by name at the reader (`inputs = {depth = "gbuffer.depth"}`), so an output has one writer by
construction. `compile.compile` turns a graph into a plan.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from deferred_ir.graph.facts import NOTHING_KNOWN, Facts
from deferred_ir.graph.pass_base import Pass
from deferred_ir.graph.ports import Description, Output


@dataclass(frozen=True)
class Node:
    """A pass under its name in a graph; `inputs` maps its ports to sources `pass.port`."""

    name: str
    work: Pass
    inputs: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Graph:
    """Nodes by name, and the outputs that a caller can ask for, each a source `pass.port`. origin: the graph's file."""

    nodes: Mapping[str, Node]
    outputs: Mapping[str, str]
    origin: str = "graph"

    def find_obstacle(self) -> str | None:
        """Return why a pass cannot run on this machine, and the mend, in a line; None if all can."""
        found = ((node.name, node.work.find_obstacle()) for node in self.nodes.values())
        return next((f"{self.origin}: {name}: {obstacle}" for name, obstacle in found if obstacle), None)


@dataclass(frozen=True)
class Step:
    """A node with everything resolved. `sources`: port -> (pass, port), None where nothing is connected."""

    name: str
    work: Pass
    sources: Mapping[str, tuple[str, str] | None]
    outputs: Mapping[str, Output]
    descriptions: Mapping[str, Description | None]


@dataclass(frozen=True)
class Plan:
    """What runs, in order; why the rest does not; and when each resource is first written and last read.

    facts: what is known of its frames: the facts that it was compiled for, and what the passes that run state.
    origin: the graph's file.
    """

    steps: tuple[Step, ...]
    outputs: Mapping[str, tuple[str, str]]
    left_out: Mapping[str, str]
    lifetimes: Mapping[tuple[str, str], tuple[int, int]]
    facts: Facts = NOTHING_KNOWN
    origin: str = "graph"

    @property
    def frames_to_fill(self) -> int:
        """Frames of a still scene until the image is complete; 1 where no pass keeps anything between frames."""
        return max((step.work.frames_to_fill() for step in self.steps), default=1)

    @property
    def retains_samples(self) -> bool:
        """Whether an image holds samples of earlier frames, so that the time of a frame is not what it took."""
        return any(step.work.retains_samples for step in self.steps)
