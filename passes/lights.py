"""Pack the scene's direct lights for the shaders: -> lights."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from deferred_ir.frame.direct_lights import LightVersions, describe_output, find_view_owners, pack_lights
from deferred_ir.frame.frame import Frame
from deferred_ir.frame.light_culling import AXES, LIGHTS_DROPPED, find_shining
from deferred_ir.frame.pass_io import Io
from deferred_ir.frame.vpl_buffer import make_axes
from deferred_ir.graph.pass_base import Pass
from deferred_ir.graph.ports import Description, Output
from deferred_ir.scene.scene import Scene


class Lights(Pass):
    """The direct lights; those that light nothing in view have their power set to 0."""

    State = LightVersions
    figures = (LIGHTS_DROPPED,)

    def outputs(self, inputs: Mapping[str, Description | None]) -> Mapping[str, Output]:
        """One buffer."""
        del inputs
        return {"lights": describe_output()}

    def depends(self) -> frozenset[str]:
        """The lights, and the models, which may move in front of them."""
        return frozenset({"light", "models"})

    def execute(self, frame: Frame, io: Io) -> None:
        """Pack and upload."""
        records = pack_lights(frame.scene)
        versions = io.state.update(records, frame.scene)
        if frame.by_view and find_shining(records).any():
            seen, owners = frame.seen_clusters.find_reaching(_list_cones(frame.scene)), find_view_owners(frame.scene)
            reaches = np.ones(len(records), bool)  # without views nothing is known
            reaches[owners] = False
            reaches[owners[seen]] = True
            records["emission"][~reaches] = 0
            io.count(LIGHTS_DROPPED.name, int((~reaches).sum()))
        io["lights"].write(records, versions)


def _list_cones(scene: Scene) -> np.ndarray:
    """Return the pyramids about what the lights' views cover, AXES (m,)."""
    views = [view for light in scene.direct_lights for view in light.list_views(scene.bounds)]
    cones = np.zeros(len(views), AXES)
    for cone, view in zip(cones, views, strict=True):
        cone["position"] = view.position
        cone["x_axis"], cone["y_axis"], cone["z_axis"] = (axis[0] for axis in make_axes(view.axis[None], view.fov))
    return cones


PASS = Lights
