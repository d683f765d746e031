"""Which triangles each light's map draws: the scene's own, or for VPLs a mesh that stands in for them."""

from __future__ import annotations

import numpy as np

from .frame import Frame
from .gl.cluster_buffers import ClusterBuffers
from .maps import MapParams
from .typing import Bools


def of_vpls(frame: Frame, params: MapParams) -> ClusterBuffers:
    """What the maps of VPLs draw."""
    del params
    return frame.buffers.cluster_buffers


def shares(frame: Frame, params: MapParams, records: np.ndarray) -> list[tuple[ClusterBuffers, Bools]]:
    """Meshes, and which of the lights with LIGHT records (n,) draw each, bool (n,). The spotlight draws the scene."""
    own, other, vpls = frame.buffers.cluster_buffers, of_vpls(frame, params), records["tile"] >= 0
    if other is own:
        return [(own, np.ones(len(records), bool))]
    return [(mesh, lights) for mesh, lights in ((own, ~vpls), (other, vpls)) if lights.any()]
