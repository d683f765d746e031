"""Passes that only have ports, and graphs of them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from deferred_ir.graph.facts import Fact
from deferred_ir.graph.graph import Graph, Node, Plan
from deferred_ir.graph.pass_base import Pass
from deferred_ir.graph.ports import Input, Output, Texture

SHINES = Fact("shines", unknown=True, doc="The light is on.", needs=True)


class Fake(Pass):
    """A pass with these ports; `unneeded_because` is its answer to a scene whose light is off."""

    def __init__(
        self,
        inputs: Mapping[str, Input] | None = None,
        outputs: Mapping[str, str] | None = None,
        unneeded_because: str | None = None,
    ) -> None:
        super().__init__()
        self.inputs = inputs or {}
        self.written = {"out": "rgba8"} if outputs is None else outputs
        self.reason = unneeded_because

    def outputs(self, inputs):
        assert set(inputs) == set(self.inputs)
        return {port: Output("", Texture(format)) for port, format in self.written.items()}

    def unneeded(self, facts):
        return None if facts[SHINES] else self.reason


def graph(outputs: Mapping[str, str] | None = None, /, **nodes: tuple[Pass, Mapping[str, str]]) -> Graph:
    made = {name: Node(name, work, wires) for name, (work, wires) in nodes.items()}
    return Graph(made, outputs or {"image": f"{list(nodes)[-1]}.out"}, "some.toml")


def reads(*ports: str, **options: Any) -> dict[str, Input]:
    return {port: Input("", **options) for port in ports}


def source(format: str = "rgba8", **more: str) -> tuple[Pass, Mapping[str, str]]:
    return Fake(outputs={"out": format, **more}), {}


def names(plan: Plan) -> list[str]:
    return [step.name for step in plan.steps]


def diamond() -> Graph:
    """A graph in which two passes read the first one's output and a later pass reads both."""
    return graph(
        end=(Fake(reads("l", "r")), {"l": "left.out", "r": "right.out"}),
        left=(Fake(reads("x")), {"x": "start.out"}),
        right=(Fake(reads("x")), {"x": "start.out"}),
        start=source(),
        last=(Fake(reads("x")), {"x": "end.out"}),
    )
