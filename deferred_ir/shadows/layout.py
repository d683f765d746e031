"""Where the maps of direct lights lie in the atlas, and how large they are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from deferred_ir.base.errors import GraphError
from deferred_ir.shadows.settings import MapParams

LEAST_SIZE = 16
"""Edge of the smallest map, texels."""


@dataclass(frozen=True)
class ViewLayout:
    """Where the maps of n views lie in the atlas. sizes: edges, texels. places: layer, x and y of lower left corners.

    halved: how often all edges were halved to fit the budget.
    """

    sizes: tuple[int, ...]
    places: tuple[tuple[int, int, int], ...]
    layers: int
    halved: int


def lay_out(halvings: Sequence[int], params: MapParams, edge: int) -> ViewLayout:
    """Lay out maps of views, `halvings` (n,) each, in layers of `edge` texels.

    Several share half of the budget: all edges are halved until they fit. Raises GraphError if they are too many.
    """
    room = params.budget * 2**20 // 2
    for halved in range(16):
        layout = _lay_out([params.spot_size >> (own + halved) for own in halvings], edge, halved)
        if len(halvings) <= 1 or layout.layers * 4 * edge**2 <= room:
            return layout
        if min(layout.sizes) < 2 * LEAST_SIZE:
            break
    raise GraphError(
        f"{len(halvings)} maps of direct lights, however small, do not fit into half of shadow_maps.budget, "
        f"{params.budget} MiB; use fewer lights or a larger budget"
    )


def _lay_out(sizes: list[int], edge: int, halved: int) -> ViewLayout:
    """Put maps of these sizes into layers, those of each size into layers of their own."""
    places, layers = [(0, 0, 0)] * len(sizes), 0
    for size in sorted(set(sizes), reverse=True):
        across = edge // size
        same = [i for i, other in enumerate(sizes) if other == size]
        for number, i in enumerate(same):
            layer, place = divmod(number, across**2)
            places[i] = (layers + layer, place % across * size, place // across * size)
        layers += -(-len(same) // across**2)
    return ViewLayout(tuple(sizes), tuple(places), layers, halved)


def explain_resolution(halvings: Sequence[int], params: MapParams, edge: int) -> str:
    """Return what maps cannot resolve, and that they are smaller than asked for where they are."""
    halved = lay_out(halvings, params, edge).halved
    smaller = f", {2**halved} times as coarse as spot_size says to fit shadow_maps.budget" if halved else ""
    return f"shadows are as fine as the maps' texels{smaller}"
