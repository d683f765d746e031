"""Maps that are drawn together: of one projection, of views of direct lights or of VPLs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from deferred_ir.base.arrays import Array, Bools, Ints
from deferred_ir.frame.vpl_buffer import VPL
from deferred_ir.meshes.clusters import Clusters
from deferred_ir.shadows.settings import MapParams
from deferred_ir.shadows.views import PARABOLOID, PARALLEL, PLANAR, find_projections


@dataclass(frozen=True, eq=False)
class MapBatch:
    """Maps that are drawn together: the rows `chosen` (m,) of the bound block of VPLs or of views, `records` (n,).

    projection: of all of them. size: of the maps, texels, one or (m,).
    """

    records: np.ndarray
    chosen: Ints
    projection: int
    size: Array | float

    @property
    def vpls(self) -> bool:
        """Whether they are VPLs'."""
        return bool(self.records.dtype == VPL)

    @property
    def defines(self) -> dict[str, int | float]:
        """Tells shaders which block they draw from, and how."""
        return {"DRAWS_VPLS": int(self.vpls), "DRAWN_PROJECTION": self.projection}

    def find_visible(self, clusters: Clusters) -> Bools:
        """Return which clusters may show in which of the maps, bool (m, C)."""
        if self.projection == PARALLEL:  # they cover the whole scene
            return np.ones((len(self.chosen), len(clusters)), bool)
        return clusters.find_visible(self.records[self.chosen], hemisphere=self.projection == PARABOLOID)


def make_batches(records: np.ndarray, chosen: Ints, params: MapParams) -> Iterator[MapBatch]:
    """Yield the maps of the rows `chosen` (m,) of VPL or VIEW records (n,), those of each projection together."""
    found = find_projections(records, params)[chosen]
    for projection in (PLANAR, PARABOLOID, PARALLEL):
        rows = chosen[found == projection]
        if len(rows):
            size = params.vpl_size if records.dtype == VPL else records["size"][rows].astype(float)
            yield MapBatch(records, rows, projection, size)
