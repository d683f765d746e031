"""Defines that leave out of lighting shaders the code that the current scene does not need.

With `keep_all` they suit any scene. Every variant gives the same pixels.
"""

from __future__ import annotations

import numpy as np

from deferred_ir.frame.frame import Frame

Defines = dict[str, int | float]


def choose_for_pixels(frame: Frame, vpls: np.ndarray) -> Defines:
    """Return defines of shaders that add up VPLs: SMOOTH for shading normals, CLAMPED for a clamp. vpls: VPL (n,)."""
    clamped = frame.keep_all or not len(vpls) or bool(vpls["clamp_squared"][0] > 0)
    return {"SMOOTH": int(frame.smooth), "CLAMPED": int(clamped)}


def choose_for_lights(frame: Frame, lights: np.ndarray, views: np.ndarray | None) -> Defines:
    """Return the defines of shaders that add up direct lights: DISC for soft ones, and the views' common projection.

    lights: LIGHT (n,). views: VIEW (m,), None if there are no shadow maps.
    """
    defines: Defines = {"DISC": int((lights["radius"] > 0).any())}
    if views is not None and not frame.keep_all and len(set(views["paraboloid"].tolist())) == 1:
        defines["VIEWS_PARABOLOID"] = int(views["paraboloid"][0])
    return defines
