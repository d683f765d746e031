"""Parameters of VPLs, and the facts that passes about VPLs state and ask for. No OpenGL."""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt
from typing import Literal

from deferred_ir.frame.facts import EMITS, SAMPLED
from deferred_ir.graph.facts import Fact, Facts, Statements
from deferred_ir.graph.figures import Figure
from deferred_ir.graph.params import param
from deferred_ir.sampling.patterns import Pattern
from deferred_ir.vpls.kernel import VplLimits

VPLS = Fact("vpls", unknown=True, doc="VPLs may shine.", needs=True)
CLAMPED = Fact("clamped", unknown=True, doc="VPLs light what is near them with less than they should.", needs=True)
SHARES = Fact("shares", unknown=1, doc="Interleaving factor: a pixel is shaded with 1/shares of the VPLs.")
CLAMP = Fact("clamp", unknown=0.0, doc="Distance below which VPLs' 1/d^2 is held, as a fraction of the diagonal.")
CONE = Fact[float | None]("cone", unknown=None, doc="Opening angle of the cone that VPLs shine into, degrees.")
CLAMP_RETURNED = Fact("clamp_returned", unknown=False, doc="Short rays add the light that the clamp takes from VPLs.")

VPLS_ALIVE = Figure("vpls_alive", "VPLs that shine.", ("vpls_alive",))


def explain_no_vpls(facts: Facts) -> str | None:
    """Return why a pass that works on VPLs is not needed; None if there may be VPLs."""
    return None if facts[VPLS] else "there are no VPLs: vpl.count is 0, or nothing shines"


FULL_CONE = 179.0
"""Opening angle from which a cone loses no light to speak of, degrees."""
AUTO_CLAMP = 0.64
"""Clamp distance of one VPL in diagonals where short rays give back what it takes: best at 64 to 1024 VPLs of both a
room and a cathedral, and flat about there (half or twice of it costs a tenth to a half of the error)."""


@dataclass(frozen=True)
class VplParams:
    """Parameters of VPLs, wherever they come from."""

    count: int = param(64, lo=0, hi=65536, role="vpls", doc="Rays that leave the lights; each that lands makes a VPL.")
    fov: float = param(150.0, lo=1.0, hi=179.9, doc="Full opening angle of the cone a VPL shines into, degrees.")
    clamp: float | Literal["auto"] = param(
        0.02,
        lo=0.0,
        hi=10.0,
        doc="Distance below which 1/d^2 is held, as a fraction of the scene's diagonal; auto: 0.64 / sqrt(count).",
    )

    @property
    def clamp_fraction(self) -> float:
        """The clamp distance in diagonals. auto: in proportion to the distance between VPLs, whose spikes it holds."""
        return AUTO_CLAMP / sqrt(max(self.count, 1)) if self.clamp == "auto" else self.clamp

    def limits(self, diagonal: float) -> VplLimits:
        """Return cone and clamp of VPLs in a scene of this diagonal."""
        return VplLimits.from_angle(self.fov, self.clamp_fraction * diagonal)

    def state_facts(self, facts: Facts) -> Statements:
        """State whether VPLs may shine, from the facts of the scene, and what limits their light."""
        cast, clamp = self.count > 0 and facts[EMITS], self.clamp_fraction
        points = facts[SAMPLED] and facts[EMITS]
        return {VPLS: cast or points, CLAMPED: cast and clamp > 0, CLAMP: clamp, CONE: self.fov}

    def explain_lost_light(self, facts: Facts) -> str | None:
        """Return how VPLs lose light in all frames alike, None if they do not."""
        if not facts[VPLS]:
            return None
        lost = [
            f"VPLs shine into cones of {self.fov:g} degrees" if self.fov < FULL_CONE else "",
            "their light is clamped" if facts[CLAMPED] and not facts[CLAMP_RETURNED] else "",
        ]
        return ", ".join(filter(None, lost)) or None


@dataclass(frozen=True)
class CastParams(VplParams):
    """Parameters of VPLs that are cast anew for each image, in a render and in a reference."""

    pattern: Pattern = param("sobol", doc="Sample pattern on the disc of directions.")
    bounces: int = param(1, lo=1, hi=64, role="bounces", doc="Diffuse bounces; each beyond the first adds VPLs.")
