"""Lights that light nothing which the camera sees keep their record and their tile, but lose their power. No OpenGL.

Where VPLs are looped over, those with power stand first in each part that one draw adds up, in their order. So sums
have the terms that they have with all VPLs but for zeros, in the same order, and are the same to the last bit.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from deferred_ir.base.arrays import Bools, Ints
from deferred_ir.graph.figures import Figure
from deferred_ir.meshes.clusters import Clusters
from deferred_ir.scene.camera import Camera

LIGHTS_DROPPED = Figure(
    "lights_dropped",
    "Lights whose map is not drawn.",
    left_out=("maps of {n} lights", "they light nothing that is seen"),
)

MARGIN = 1e-5
"""Tolerance, as a fraction of the largest distance in a pixel's position: 32-bit depths err by 1e-7."""
AXES = np.dtype([(name, "f4", 3) for name in ("position", "x_axis", "y_axis", "z_axis")])
STRIDE = 16
"""One cluster is enough to keep a light, and nearly all find theirs among every 16th."""


def find_shining(records: np.ndarray) -> Bools:
    """Return which records (n,), of direct lights or VPLs, have power, bool (n,)."""
    lit: Bools = (records["emission"] != 0).any(axis=1)
    return lit


def count_shining(records: np.ndarray) -> int:
    """Return how many of the VPL records (n,) must be looped over: up to the last that has power."""
    lit = np.flatnonzero(find_shining(records))
    return int(lit[-1]) + 1 if len(lit) else 0


def put_shining_first(records: np.ndarray, starts: Ints) -> np.ndarray:
    """Return VPL records (n,), those with power first in each of the parts that begin at `starts`, ascending."""
    part = np.searchsorted(starts, np.arange(len(records)), side="right")
    return records[np.lexsort((~find_shining(records), part))]


@dataclass(frozen=True, eq=False)
class SeenClusters:
    """The clusters `chosen`, int (m,), that lie in the camera's pyramid. margin: by which lights may miss them."""

    clusters: Clusters
    chosen: Ints
    margin: float

    def find_reaching(self, records: np.ndarray) -> Bools:
        """Return which lights may light one of them, bool (n,).

        records: VPL (n,), or others with the axes of a view that is as wide as the light's cone.
        """
        pyramids = records.dtype == AXES
        reaches: Bools = np.zeros(len(records), bool) if pyramids else records["tan_half"] == 0  # from infinity
        for some in (self.chosen[::STRIDE], self.chosen):
            left = np.flatnonzero(~reaches)
            if not len(left):
                break
            reaches[left] = self.clusters.find_within(records[left], margin=self.margin, only=some).any(axis=1)
        return reaches


def find_seen_clusters(clusters: Clusters, camera: Camera, size: tuple[int, int]) -> SeenClusters:
    """Return what `camera` may see in a frame of `size` (width, height)."""
    rays = camera.ray_axes(size)
    view = np.zeros(1, AXES)
    view["position"] = camera.position
    # As a light's: NDC = dot(d, axis) / dot(d, z).
    view["x_axis"], view["y_axis"], view["z_axis"] = rays / (rays**2).sum(axis=1, keepdims=True)
    margin = MARGIN * (clusters.reach + float(np.abs(camera.position).max()))
    return SeenClusters(clusters, np.flatnonzero(clusters.find_within(view, margin=margin)[0]), margin)
