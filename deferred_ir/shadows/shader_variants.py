"""Defines that leave out of lighting shaders the code that the current scene does not need.

With `keep_all` they suit any scene. Every variant gives the same pixels.
"""

from __future__ import annotations

import numpy as np

from deferred_ir.frame.direct_lights import VIEWS_PER_LIGHT, list_kinds
from deferred_ir.frame.frame import Frame
from deferred_ir.frame.vpl_buffer import HEMISPHERE

Defines = dict[str, int | float | str]


def choose_for_pixels(frame: Frame, vpls: np.ndarray) -> Defines:
    """Return defines of shaders that add up VPLs (n,): SMOOTH for shading normals, CLAMPED for a clamp, and what of
    lights there is among them: PARALLEL ones, from infinity, and MIXED projections of maps.
    """
    clamped = frame.keep_all or not len(vpls) or bool((vpls["clamp_squared"] > 0).any())
    parallel = frame.keep_all or bool(len(vpls) and (vpls["tan_half"] == 0).any())
    mixed = parallel or bool(len(vpls) and (vpls["one_minus_cos"] >= HEMISPHERE).any())
    return {"SMOOTH": int(frame.smooth), "CLAMPED": int(clamped), "PARALLEL": int(parallel), "MIXED": int(mixed)}


def choose_for_lights(frame: Frame, lights: np.ndarray, views: np.ndarray | None) -> Defines:
    """Return the defines of shaders that add up direct lights.

    LIGHT_KINDS, and STRENGTH_0 to that, the function for each kind; DISC for soft shadows; VIEWS_PER_LIGHT, and the
    views' common projection. lights: LIGHT (n,). views: VIEW (m,), None if there are no shadow maps.
    """
    kinds = list_kinds(frame.scene, every=frame.keep_all) or ["spotlight"]
    defines: Defines = {"DISC": int((lights["radius"] > 0).any()), "LIGHT_KINDS": len(kinds)}
    defines |= {f"STRENGTH_{number}": f"{kind}_strength" for number, kind in enumerate(kinds)}
    if views is not None:
        most = VIEWS_PER_LIGHT if frame.keep_all else int(lights["views"].max(initial=1))
        defines["VIEWS_PER_LIGHT"] = max(most, 1)
        if not frame.keep_all and len(set(views["projection"][views["size"] > 0].tolist())) == 1:
            defines["VIEWS_PROJECTION"] = int(views["projection"][0])
    return defines
