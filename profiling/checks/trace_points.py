"""References of images in which points stand for lights: the same points and VPLs, with visibility by rays."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from deferred_ir.base.arrays import Array
from deferred_ir.rays.tracer import Hits, Tracer
from deferred_ir.scene.lights.base import end_outside
from deferred_ir.scene.recentre import recentre
from deferred_ir.scene.scene import Scene
from deferred_ir.truth.path_tracer import PathTracer
from deferred_ir.truth.reference import Reference, make_vpl_params
from deferred_ir.vpls.cast import NONE, Vpls, cast
from deferred_ir.vpls.kernel import VplLimits
from deferred_ir.vpls.ray_sum import sum_radiance
from deferred_ir.vpls.sample_lights import PointSet, sample_lights


def trace_with_points(
    scene: Scene, size: tuple[int, int], *, vpls: int, bounces: int, settings: Mapping[str, Any], samples: int
) -> Reference:
    """Trace an image of `scene` at rest. samples: points of lights. Others as in `trace_reference`."""
    scene = recentre(scene)
    tracer = Tracer(scene)
    paths = PathTracer(scene, tracer)
    seen = paths.trace_camera_rays(size)
    params = make_vpl_params({**settings, "vpl.count": vpls})
    lights = cast(scene.emitters, tracer, vpls, params.pattern, bounces=bounces) if bounces else NONE
    indirect = sum_radiance(tracer, seen, lights, params.limits(scene.geometry.diagonal))
    direct = sum_points(tracer, seen, sample_lights(scene.sampled_lights, scene.bounds, samples))
    dark = tuple(replace(material, emission=(0.0, 0.0, 0.0)) for material in scene.materials)
    plain = replace(scene, lights=scene.direct_lights, materials=dark)
    shape = (size[1], size[0], 3)
    direct = direct.reshape(shape) + PathTracer(plain, Tracer(plain)).estimate_direct(size, 256)
    indirect, emission = indirect.reshape(shape), paths.find_emission(size, seen).reshape(shape)
    hit, meta = seen.hit.reshape(shape[:2]), {"vpls": vpls, "samples": samples}
    return Reference(direct + indirect + emission, direct, indirect, emission, hit, None, meta)


def sum_points(tracer: Tracer, seen: Hits, points: PointSet) -> Array:
    """Return the radiance that surfaces `seen` (n) reflect of `points` of lights, float64 (n, 3)."""
    near = np.flatnonzero(~points.parallel)
    vpls = Vpls(points.position[near], points.normal[near], points.emission[near], near)
    total = sum_radiance(tracer, seen, vpls, VplLimits(clamp=0.0))
    bounds = tracer.scene.bounds
    lifted = tracer.lift(seen.position, seen.normal)
    for direction, irradiance in zip(-points.normal[points.parallel], points.emission[points.parallel], strict=True):
        cosine = seen.shading_normal @ direction
        lit = np.flatnonzero(seen.hit & (cosine > 0) & (seen.normal @ direction > 0))
        way = np.broadcast_to(direction, (len(lit), 3))
        lit = lit[~tracer.occluded(lifted[lit], end_outside(lifted[lit], way, bounds))]
        total[lit] += seen.albedo[lit] / np.pi * np.multiply.outer(cosine[lit], irradiance)
    return total
