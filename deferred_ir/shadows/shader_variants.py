"""Defines by which shaders that light pixels have no code for what the scene at hand does not have.

With `keep_all` they are those for any scene. Every variant gives the same pixels.
"""

from __future__ import annotations

import numpy as np

from deferred_ir.frame.frame import Frame

Defines = dict[str, int | float]


def choose_for_pixels(frame: Frame, vpls: np.ndarray) -> Defines:
    """Return defines for pixels that VPLs light: whether there are shading normals, and a clamp. vpls: VPL (n,)."""
    clamped = frame.keep_all or not len(vpls) or bool(vpls["clamp_squared"][0] > 0)
    return {"SMOOTH": int(frame.smooth), "CLAMPED": int(clamped)}


def choose_for_lights(frame: Frame, lights: np.ndarray, views: np.ndarray | None) -> Defines:
    """Return defines for what direct lights light: whether one is a disc, and the projection that all views have.

    lights: LIGHT (n,). views: VIEW (m,), None where shadows come from elsewhere.
    """
    defines: Defines = {"DISC": int((lights["radius"] > 0).any())}
    if views is not None and not frame.keep_all and len(set(views["paraboloid"].tolist())) == 1:
        defines["VIEWS_PARABOLOID"] = int(views["paraboloid"][0])
    return defines
