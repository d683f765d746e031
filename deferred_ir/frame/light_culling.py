"""Lights that light nothing which the camera sees keep their record and their tile, but lose their power. No OpenGL.

Where lights are looped over, those with power stand first in each part that one draw adds up, in their order. So sums
have the terms that they have with all lights but for zeros, in the same order, and are the same to the last bit.
"""

from __future__ import annotations

import numpy as np

from deferred_ir.base.arrays import Bools, Ints
from deferred_ir.meshes.clusters import Clusters
from deferred_ir.scene.camera import Camera
from deferred_ir.scene.lights.spot import LIGHT, LIGHTS_PER_BLOCK

MARGIN = 1e-5
"""Of the largest distances that pixels' positions are made of: they come back from a depth, and 32 bits err by 1e-7."""
STRIDE = 16
"""One cluster is enough to keep a light, and nearly all find theirs among every 16th."""


def shining(records: np.ndarray) -> Bools:
    """Which LIGHT records (n,) have power, bool (n,)."""
    lit: Bools = (records["emission"] != 0).any(axis=1)
    return lit


def last_shining(records: np.ndarray) -> int:
    """How many of the LIGHT records (n,) must be looped over: up to the last that has power."""
    lit = np.flatnonzero(shining(records))
    return int(lit[-1]) + 1 if len(lit) else 0


def shining_first(records: np.ndarray, starts: Ints) -> np.ndarray:
    """LIGHT records (n,) with those first that have power, in each of the parts that begin at `starts`, ascending."""
    part = np.searchsorted(starts, np.arange(len(records)), side="right")
    return records[np.lexsort((~shining(records), part))]


def in_order(records: np.ndarray) -> Ints:
    """Rows of LIGHT records (n,) by their tiles in each block: as they were made, the spotlight first."""
    order: Ints = np.lexsort((records["tile"], np.arange(len(records)) // LIGHTS_PER_BLOCK))
    return order


def dropped(records: np.ndarray, clusters: Clusters, camera: Camera, size: tuple[int, int]) -> np.ndarray:
    """The light buffer `records`, LIGHT (n,), the spotlight first, without the power of what `camera` sees nothing of.

    size: of the frame, (width, height). In each block those with power come first, behind the spotlight.
    """
    needless = ~reaching(records, clusters, camera, size)
    if not needless.any():
        return records
    records = records.copy()
    records["emission"][needless] = 0
    starts = np.unique([0, 1, *range(0, len(records), LIGHTS_PER_BLOCK)])
    return shining_first(records, starts)


def reaching(records: np.ndarray, clusters: Clusters, camera: Camera, size: tuple[int, int]) -> Bools:
    """Which lights may light something that `camera` sees, LIGHT records (n,): bool (n,).

    The others shine on no cluster that lies in the camera's pyramid.
    """
    rays = camera.ray_axes(size)
    view = np.zeros(1, LIGHT)
    view["position"] = camera.position
    # As a light's: NDC = dot(d, axis) / dot(d, z).
    view["x_axis"], view["y_axis"], view["z_axis"] = rays / (rays**2).sum(axis=1, keepdims=True)
    margin = MARGIN * (clusters.reach + float(np.abs(camera.position).max()))
    seen = np.flatnonzero(clusters.find_within(view, margin=margin)[0])
    reaches = np.zeros(len(records), bool)
    for some in (seen[::STRIDE], seen):
        left = np.flatnonzero(~reaches)
        reaches[left] = clusters.find_within(records[left], margin=margin, only=some).any(axis=1)
    return reaches
