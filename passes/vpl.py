"""Cast VPLs (Keller 1997) on the CPU: -> lights, the spotlight's record and then one for each living VPL."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import sqrt
from typing import Any, Literal

import numpy as np

from deferred_ir.frame import Frame
from deferred_ir.graph import Buffer, Description, Facts, Output, Pass
from deferred_ir.io import Io
from deferred_ir.lights import LIGHT, LIGHTS_PER_BLOCK, SPOT_TILE, fill_records
from deferred_ir.params import param
from deferred_ir.resampling import effects, probes, resample
from deferred_ir.sampling import Pattern, warn_unbalanced
from deferred_ir.vpls import NONE, Vpls, cast

AUTO_CLAMP = 0.64
"""Clamp distance of one VPL in diagonals where short rays give back what it takes: best at 64 to 1024 VPLs of both a
room and a cathedral, and flat about there (half or twice of it costs a tenth to a half of the error)."""


@dataclass(frozen=True)
class Params:
    """Parameters of the VPLs."""

    count: int = param(64, lo=0, hi=65536, doc="Rays that leave the spotlight; each that lands makes a VPL.")
    pattern: Pattern = param("sobol", doc="Sample pattern on the disc of directions.")
    bounces: int = param(1, lo=1, hi=64, doc="Diffuse bounces; each beyond the first adds VPLs.")
    fov: float = param(150.0, lo=1.0, hi=179.9, doc="Full opening angle of the cone a VPL shines into, degrees.")
    clamp: float | Literal["auto"] = param(
        0.02,
        lo=0.0,
        hi=10.0,
        doc="Distance below which 1/d^2 is held, as a fraction of the scene's diagonal; auto: 0.64 / sqrt(count).",
    )
    candidates: int = param(
        1, lo=1, hi=64, doc="Rays for each VPL that is kept, chosen by what it adds to the image. 1: all are kept."
    )

    @property
    def clamp_fraction(self) -> float:
        """The clamp distance in diagonals. auto: in proportion to the distance between VPLs, whose spikes it holds."""
        return AUTO_CLAMP / sqrt(max(self.count, 1)) if self.clamp == "auto" else self.clamp


class Vpl(Pass):
    """Traces `count` rays from the spotlight, or more and chooses, and packs what they make for the shaders."""

    Params = Params

    def __init__(self, params: Any = None) -> None:
        super().__init__(params)
        warn_unbalanced(self.params.pattern, self.params.count)

    def outputs(self, inputs: Mapping[str, Description | None]) -> Mapping[str, Output]:
        """One buffer with room for the spotlight and a VPL for each ray of each bounce."""
        del inputs
        records = Buffer("light", 1 + self.params.count * self.params.bounces, LIGHT.itemsize, LIGHTS_PER_BLOCK)
        defines = {"LIGHTS_PER_BLOCK": LIGHTS_PER_BLOCK, "BOUNCES": self.params.bounces}
        return {"lights": Output("the spotlight, then the VPLs", records, defines)}

    def informed(self, facts: Facts) -> Facts:
        """Whether there is a clamp, and anything to clamp."""
        return replace(facts, clamped=self.params.clamp_fraction > 0 and self.params.count > 0)

    def execute(self, frame: Frame, io: Io) -> None:
        """Cast, pack, upload."""
        light, p = frame.scene.spotlight, self.params
        vpls = self._cast(frame) if p.count > 0 and any(light.emission) else NONE
        records = np.zeros(1 + len(vpls), LIGHT)
        spot = np.array([light.position]), light.axis[None], np.array([light.emission])
        fill_records(records[:1], *spot, fov=light.fov, tile=SPOT_TILE)
        fill_records(
            records[1:], vpls.position, vpls.normal, vpls.emission, fov=p.fov, tile=np.arange(len(vpls), dtype="f4")
        )
        records["clamp_squared"][0] = light.radius
        records["clamp_squared"][1:] = (p.clamp_fraction * frame.scene.geometry.diagonal) ** 2
        io["lights"].write(records)
        io.count("vpls_alive", len(vpls))

    def _cast(self, frame: Frame) -> Vpls:
        """The VPLs of a frame; with candidates, `count` of them, or more where further bounces bring more."""
        p, tracer, seed = self.params, frame.tracer(), frame.seed
        vpls = cast(frame.scene.spotlight, tracer, p.count * p.candidates, p.pattern, seed, bounces=p.bounces)
        count = max(p.count, -(-len(vpls) // p.candidates))
        if len(vpls) <= count:
            return vpls
        seen = probes(tracer, frame.scene.camera, frame.size, seed)
        return resample(vpls, effects(tracer, seen, vpls, fov=p.fov, clamp=p.clamp_fraction), count, seed)


PASS = Vpl
