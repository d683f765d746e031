"""Pack the scene's direct lights for the shaders: -> lights."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from deferred_ir.base.arrays import Bools
from deferred_ir.frame.direct_lights import LightVersions, describe_output, list_kinds, pack_lights
from deferred_ir.frame.facts import DIRECT_LIGHTS
from deferred_ir.frame.frame import Frame
from deferred_ir.frame.light_culling import AXES, LIGHTS_DROPPED, find_shining
from deferred_ir.frame.pass_io import Io
from deferred_ir.frame.vpl_buffer import make_axes
from deferred_ir.graph.facts import NOTHING_KNOWN, Facts
from deferred_ir.graph.pass_base import Pass
from deferred_ir.graph.ports import Description, Output
from deferred_ir.scene.lights.base import LightView


class Lights(Pass):
    """The direct lights; those that light nothing in view have their power set to 0."""

    State = LightVersions
    figures = (LIGHTS_DROPPED,)

    def outputs(self, inputs: Mapping[str, Description | None]) -> Mapping[str, Output]:
        """Return what one spotlight needs."""
        return self.outputs_for(NOTHING_KNOWN, inputs)

    def outputs_for(self, facts: Facts, inputs: Mapping[str, Description | None]) -> Mapping[str, Output]:
        """One buffer, for as many lights as the scene has."""
        del inputs
        return {"lights": describe_output(facts[DIRECT_LIGHTS])}

    def depends(self) -> frozenset[str]:
        """The lights, and the models, which may move in front of them."""
        return frozenset({"light", "models"})

    def execute(self, frame: Frame, io: Io) -> None:
        """Pack and upload."""
        described = frame.light_views
        records = pack_lights(frame.scene, described, list_kinds(frame.scene, every=frame.keep_all))
        versions = io.state.update(records, frame.scene)
        if frame.by_view and find_shining(records).any():
            reaches = np.ones(len(records), bool)  # without views nothing is known
            reaches[described.owners] = False
            reaches[described.owners[_find_reaching(frame, described.views)]] = True
            records["emission"][~reaches] = 0
            io.count(LIGHTS_DROPPED.name, int((~reaches).sum()))
        io["lights"].write(records, versions)


def _find_reaching(frame: Frame, views: Sequence[LightView]) -> Bools:
    """Return which views may show something that the camera sees, bool (m,); parallel ones show everything."""
    cones = np.zeros(len(views), AXES)
    pointed = np.array([view.fov > 0 for view in views], bool)
    for cone, view in zip(cones, views, strict=True):
        if view.fov > 0:
            cone["position"] = view.position
            cone["x_axis"], cone["y_axis"], cone["z_axis"] = (a[0] for a in make_axes(view.axis[None], view.fov))
    reaches = np.ones(len(views), bool)
    reaches[pointed] = frame.seen_clusters.find_reaching(cones[pointed])
    return reaches


PASS = Lights
