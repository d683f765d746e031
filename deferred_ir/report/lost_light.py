"""How much indirect light a VPL image loses by design: to the clamp on 1/d^2 and to the cone of `fov`.

Estimated, not guessed: cosine-distributed rays from what the camera sees find the light that one bounce brings; a share
of it arrives from nearer than the clamp distance c, which VPLs give only d^2/c^2 of, and a share leaves its surface
outside the cone (Kollig and Keller 2004 call the first the bounded part's residual).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from deferred_ir.base.colour import LUMINANCE
from deferred_ir.frame.vpl_params import CLAMP, CLAMP_RETURNED, CONE, VPLS
from deferred_ir.graph.graph import Plan
from deferred_ir.rays.direct import AllLight
from deferred_ir.rays.tracer import Tracer
from deferred_ir.sampling import streams
from deferred_ir.sampling.warps import lift_to_hemisphere
from deferred_ir.scene.lights.spotlight import one_minus_cos
from deferred_ir.scene.scene import Scene

GRID = 128
RAYS = 8


def estimate_for(plan: Plan, make_tracer: Callable[[], Tracer]) -> dict[str, float] | None:
    """Estimate what images of `plan` lose, from what its passes state about VPLs.

    make_tracer: gives Embree over the scene of the last frame. Returns what `estimate` does, None without VPLs.
    """
    facts = plan.facts
    fov = facts[CONE]
    if fov is None or not facts[VPLS]:
        return None
    tracer = make_tracer()
    return estimate(tracer.scene, tracer, clamp=facts[CLAMP], fov=fov, returned=facts[CLAMP_RETURNED])


def estimate(
    scene: Scene, tracer: Tracer, *, clamp: float, fov: float, returned: bool = False, seed: int = 0
) -> dict[str, float] | None:
    """Estimate the relative indirect light lost to `clamp` and to the cone `fov`: {"clamp": <= 0, "wide_light": <= 0}.

    It is light of the first bounce, by luminance, over the whole image. clamp: fraction of the diagonal; fov: degrees.
    returned: short rays add what is lost within the clamp distance (deferred_ir/vpls/clamp_residual.py). Returns None
    where the camera sees no indirect light.
    """
    rng = streams.lost_light(seed)
    directions = scene.camera.rays((GRID, GRID)).reshape(-1, 3)
    seen = tracer.closest(np.broadcast_to(np.asarray(scene.camera.position, float), directions.shape), directions)
    seen_at = np.repeat(np.flatnonzero(seen.hit), RAYS)
    origins = tracer.lift(seen.position[seen_at], seen.normal[seen_at])
    # A ray each in RAYS slices of the angle, the radius at random: the disc's area, evenly.
    radius, angle = (
        np.sqrt(rng.random(len(seen_at))),
        (np.arange(len(seen_at)) % RAYS + rng.random(len(seen_at))) / RAYS,
    )
    points = np.stack([radius * np.cos(2 * np.pi * angle), radius * np.sin(2 * np.pi * angle)], axis=1)
    away = lift_to_hemisphere(points, seen.shading_normal[seen_at])
    above = np.flatnonzero((away * seen.normal[seen_at]).sum(axis=1) > 0)  # into its own face: nothing arrives
    found, hits = tracer.within(origins[above], away[above], np.inf)
    rays = above[found]
    light = AllLight(tracer)
    lit = light.irradiate(hits, rng) * light.unit
    weight = (lit * hits.reflect_diffusely(away[rays]) * seen.albedo[seen_at[rays]]) @ LUMINANCE
    total = weight.sum()
    if total <= 0:
        return None
    distance = np.linalg.norm(hits.position - origins[rays], axis=1)
    c = clamp * scene.geometry.diagonal
    reaching = np.minimum(1, (distance / c) ** 2) if c > 0 else np.ones(len(distance))
    outside = -(away[rays] * hits.normal).sum(axis=1) < 1 - one_minus_cos(fov)
    if returned:
        reaching[:] = 1
        outside &= distance > c
    return {
        "clamp": round(float((weight * (reaching - 1)).sum() / total), 5),
        "wide_light": round(float(-weight[outside].sum() / total), 5),
    }
