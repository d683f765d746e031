"""Settings in the order of their images' quality, from which those for a given time are chosen.

The order is measured: `python -m deferred_ir.profiling.checks.ladder cornell colors atrium` renders every rung, and
prints error and time. A rung that is not both better and slower than the one before it does not belong here.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from deferred_ir.graph.graph import Graph
from deferred_ir.graph.roles import find_parameters

Settings = Mapping[str, Any]
"""Parameters of passes, {"pass.param": value}."""

GRAPH = "resampled"
"""Graph of the rungs, which is taken unless another is named."""
RUNGS: tuple[Settings, ...] = (
    {
        "sample_pixels.scale": 4,
        "vpl.candidates": 8,
        "list_vpls.entries": 128,
        "choose_vpls.draws": 8,
        "choose_vpls.rays": 1,
        "near_field.samples": 0.25,
    },
    {
        "sample_pixels.scale": 3,
        "vpl.candidates": 16,
        "list_vpls.entries": 256,
        "choose_vpls.draws": 16,
        "choose_vpls.rays": 2,
    },
    {"vpl.candidates": 16, "list_vpls.entries": 256, "choose_vpls.draws": 16, "choose_vpls.rays": 2},
    {},
    {"choose_vpls.draws": 64, "filter_samples.steps": 4},
    {"sample_pixels.scale": 1, "choose_vpls.rays": 2},
    {"sample_pixels.scale": 1},
    {
        "sample_pixels.scale": 1,
        "list_vpls.entries": 1024,
        "choose_vpls.draws": 64,
        "choose_vpls.rays": 8,
        "near_field.samples": 2.0,
    },
    {
        "sample_pixels.scale": 1,
        "vpl.candidates": 256,
        "list_vpls.entries": 2048,
        "choose_vpls.draws": 128,
        "choose_vpls.rays": 16,
        "near_field.samples": 4.0,
    },
)
"""Parameters that differ from the graph's own, the coarsest first. The last is the one to average."""
VPLS = (4, 8, 16, 32, 64, 128, 256, 512, 1024)
"""Numbers of VPLs that are tried in other graphs."""


@dataclass(frozen=True)
class Rung:
    """One choice. number: its place in RUNGS, None in other graphs. work: about in proportion to its time there."""

    set: Settings
    number: int | None = None
    work: float = 1.0


def list_rungs(name: str, graph: Graph, kept: Settings) -> list[Rung]:
    """Return what may be chosen from, the coarsest first: the ladder, or numbers of VPLs in other graphs.

    kept: parameters that are given and stay as they are. What then differs from no other rung is left out.
    """
    if name == GRAPH:
        rungs = [Rung({**set, **kept}, number) for number, set in enumerate(RUNGS)]
    else:
        counts = [key for key in find_parameters(graph, "vpls") if key not in kept]
        rungs = [Rung({**kept, **dict.fromkeys(counts, vpls)}, work=vpls + 8) for vpls in VPLS] if counts else []
        rungs = rungs or [Rung(kept)]
    return [rung for rung, after in zip(rungs, [*rungs[1:], None], strict=True) if not after or rung.set != after.set]
