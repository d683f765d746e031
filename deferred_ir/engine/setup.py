"""What a Renderer draws with, as one value: to go back to how it was is to assign it again."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from deferred_ir.base.errors import GraphError
from deferred_ir.engine.settings import set_vpls
from deferred_ir.graph.file import load_graph
from deferred_ir.graph.graph import Graph, Plan
from deferred_ir.graph.pass_base import Pass

RADIANCE = "rgba32f", "rgba16f"
UNFILTERED = "unfiltered"
"""Name of the output that is radiance before any filter; where the error is estimated, it is averaged, too."""
IMAGES = {"radiance": RADIANCE, "display": ("rgba8",)}
"""Formats of the outputs that become images."""


@dataclass(frozen=True, eq=False)
class Setup:
    """Size of the image (width, height), graph by name or file, and parameters {"pass.param": value}.

    passes: the user's pass classes by type name. graphs: graphs that are loaded, by the number of VPLs that was asked
    for; plans: plans that are compiled.
    """

    size: tuple[int, int]
    name: str | Path
    set: Mapping[str, Any]
    passes: Mapping[str, type[Pass]]
    graphs: dict[int | None, Graph] = field(default_factory=dict)
    plans: dict[Any, Plan] = field(default_factory=dict)

    def graph(self, vpls: int | None = None) -> Graph:
        """Return the graph with this number of VPLs, None for its own, loading it when first asked for.

        Raises GraphError, also where a pass cannot run on this machine.
        """
        if vpls not in self.graphs:
            count = {} if vpls is None else set_vpls(self.graph(), vpls)
            graph = load_graph(self.name, {**self.set, **count}, self.passes)
            if obstacle := graph.find_obstacle():
                raise GraphError(obstacle)
            self.graphs[vpls] = graph
        return self.graphs[vpls]

    def resize(self, size: tuple[int, int]) -> Setup:
        """Return this setup with images of another size."""
        return replace(self, size=size, plans={})

    def reload(self, name: str | Path | None = None, set: Mapping[str, Any] | None = None) -> Setup:
        """Return this setup with another graph or other parameters, its files read again. Raises GraphError."""
        setup = Setup(
            self.size, self.name if name is None else name, self.set if set is None else dict(set), self.passes
        )
        setup.graph()
        return setup


def check_images(graph: Graph, plan: Plan) -> None:
    """Raise GraphError if an output that becomes an image, or is averaged beside one, is of another kind."""
    steps = {step.name: step for step in plan.steps}
    formats = {**IMAGES, UNFILTERED: RADIANCE}
    for name, (source, port) in plan.outputs.items():
        found, wanted = steps[source].outputs[port].description.format, formats.get(name)
        if wanted and found not in wanted:
            raise GraphError(
                f"{graph.origin}: outputs.{name}: wants {' or '.join(wanted)}, but {source}.{port} is {found}"
            )
