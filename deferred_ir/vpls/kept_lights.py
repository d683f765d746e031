"""VPLs of several lights that outlive their frame: those of spotlights and points; others are cast anew.

A number of VPLs is dealt to the lights by flux when they are first seen, and stays dealt so while lights of the same
kinds shine, however bright. All others together are one: their rays are the same in each frame, so that while they
stay, so do their VPLs and maps.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeGuard

import numpy as np

from deferred_ir.base.arrays import Bools, Ints
from deferred_ir.rays.tracer import Tracer
from deferred_ir.sampling import streams
from deferred_ir.scene.lights.base import Light
from deferred_ir.scene.lights.point import Point
from deferred_ir.scene.lights.spotlight import Spotlight
from deferred_ir.vpls.cast import NONE, Vpls, cast, join
from deferred_ir.vpls.emission_disc import KeptLight
from deferred_ir.vpls.incremental import IncrementalVpls


@dataclass(frozen=True, eq=False)
class FrameVpls:
    """The VPLs of a frame; `ray` numbers their slots.

    kept: bool (n,), which outlive the frame. versions: int (n,), of their maps; 0 for others.
    """

    vpls: Vpls
    versions: Ints
    kept: Bools


class KeptVpls:
    """`count` slots for the VPLs of several lights. The same `seed` and the same frames give the same VPLs again."""

    def __init__(self, count: int, seed: int = 0) -> None:
        self._count, self._seed = count, seed
        self._shining: tuple[tuple[str, bool], ...] | None = None
        self._dealt: list[int] = []
        self._own: dict[int, IncrementalVpls] = {}

    @property
    def at_rest(self) -> bool:
        """Whether the next frame changes nothing while nothing moves."""
        return all(own.at_rest for own in self._own.values())

    @property
    def waiting(self) -> int:
        """How many sites the budget has not allowed so far."""
        return sum(own.waiting for own in self._own.values())

    def update(self, lights: Sequence[Light], tracer: Tracer, *, least: int, most: int) -> FrameVpls:
        """Advance to the next frame of `lights`, which shine. least, most: see `IncrementalVpls.update`."""
        shining = tuple((light.kind, is_kept(light)) for light in lights)
        others = [light for light in lights if not is_kept(light)]
        kept = [light for light in lights if is_kept(light)]
        if shining != self._shining:
            self._deal(kept, others, tracer)
            self._shining = shining
        starts = np.cumsum([0, *self._dealt])
        found: dict[int, tuple[Vpls, Ints]] = {}
        # Those with most to do come first.
        for i in sorted(self._own, key=lambda i: -self._own[i].waiting):
            own = self._own[i]
            before = own.version.copy()
            vpls = own.update(kept[i], tracer, least=min(least, most), most=most)
            most -= int((own.version != before).sum())
            found[i] = Vpls(vpls.position, vpls.normal, vpls.emission, vpls.ray + starts[i]), own.version[vpls.ray]
        rest = cast(others, tracer, self._dealt[-1], "sobol", self._seed) if others else NONE
        rest = Vpls(rest.position, rest.normal, rest.emission, rest.ray + starts[len(kept)])
        parts = [found[i] for i in sorted(found)]
        versions = np.concatenate([*(versions for _, versions in parts), np.zeros(len(rest), int)])
        return FrameVpls(
            join([*(vpls for vpls, _ in parts), rest]), versions, np.arange(len(versions)) < len(versions) - len(rest)
        )

    def _deal(self, kept: Sequence[KeptLight], others: Sequence[Light], tracer: Tracer) -> None:
        """Deal the slots by flux, at least one to each while there are any, and start over."""
        bounds = tracer.scene.bounds
        flux = np.array([*(x.measure_flux(bounds) for x in kept), sum(x.measure_flux(bounds) for x in others)])
        ends = np.round(np.cumsum(flux) / max(float(flux.sum()), np.finfo(float).tiny) * self._count).astype(int)
        self._dealt = np.diff(ends, prepend=0).tolist()
        self._own = {
            i: IncrementalVpls(count, streams.frame_seed(self._seed, i))
            for i, count in enumerate(self._dealt[:-1])
            if count
        }


def is_kept(light: Light) -> TypeGuard[KeptLight]:
    """Return whether the VPLs of a light outlive their frame."""
    return isinstance(light, Spotlight) or (isinstance(light, Point) and not light.has_area)
