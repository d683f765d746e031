"""Defines by which shaders that light pixels have no code for what the scene at hand does not have.

With `keep_all` they are those for any scene. Every variant gives the same pixels.
"""

from __future__ import annotations

import numpy as np

from deferred_ir.frame.frame import Frame
from deferred_ir.scene.lights.spot import is_disc
from deferred_ir.shadows.settings import WIDE


def of_pixels(frame: Frame, vpls: np.ndarray) -> dict[str, int | float]:
    """For pixels that VPLs light, LIGHT records (n,): whether there are shading normals, and a clamp."""
    clamped = frame.keep_all or not len(vpls) or bool(vpls["clamp_squared"][0] > 0)
    return {"SMOOTH": int(frame.smooth), "CLAMPED": int(clamped)}


def of_spotlight(frame: Frame, lights: np.ndarray) -> dict[str, int | float]:
    """For what the spotlight lights, the first of the LIGHT records (n,): whether it is a disc, and its projection."""
    disc: dict[str, int | float] = {"DISC": int(is_disc(lights))}
    return disc if frame.keep_all else {**disc, "SPOT_PARABOLOID": int(lights["one_minus_cos"][0] > WIDE)}
