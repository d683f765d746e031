"""Points that stand for lights which have an area or lie all around: VPLs of bounce 0, which bring direct light.

All lights share a number of points, dealt by flux as rays are (`cast.deal_rays`): each light's light is right in the
mean over seeds, however few points it gets.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from deferred_ir.base.arrays import Array, Bools
from deferred_ir.sampling import streams
from deferred_ir.sampling.patterns import sample_unit_square
from deferred_ir.scene.lights.base import Bounds, SampledLight
from deferred_ir.vpls.cast import deal_rays


@dataclass(frozen=True, eq=False)
class PointSet:
    """n points of lights, arrays (n, 3) as in `LightSamples`. parallel: which of them lie at infinity, bool (n,)."""

    position: Array
    normal: Array
    emission: Array
    parallel: Bools

    def __len__(self) -> int:
        return len(self.parallel)


def sample_lights(lights: Sequence[SampledLight], bounds: Bounds, count: int, seed: int = 0) -> PointSet:
    """Return up to `count` points that stand for `lights`: those that carry nothing are left out."""
    square = sample_unit_square("sobol", count, streams.light_points(seed))
    nothing: Array = np.zeros((0, 3))
    parts: list[tuple[Array, Array, Array, Bools]] = [(nothing, nothing, nothing, np.zeros(0, bool))]
    for light, part, factor in deal_rays(lights, bounds, count, seed):
        found = light.spread(square[part], bounds)
        parallel = np.full(len(found.position), light.at_infinity)
        parts.append((found.position, found.normal, found.emission * factor, parallel))
    position, normal, emission, parallel = (np.concatenate(column) for column in zip(*parts, strict=True))
    shining = np.flatnonzero((emission > 0).any(axis=1))
    return PointSet(position[shining], normal[shining], emission[shining], parallel[shining])
