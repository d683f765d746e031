"""Parameters of the passes that draw shadow maps, and the limits that they check."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from deferred_ir.base.arrays import Array
from deferred_ir.base.errors import GraphError
from deferred_ir.graph.facts import Fact
from deferred_ir.graph.params import param

SPOT_MAP = Fact("spot_map", unknown=False, doc="The graph can draw a shadow map of the spotlight.")
MOST_LAYERS = 2048
"""Layers of an array texture that every driver of OpenGL 4.3 supports."""

LEAST_REACH = 2.0
"""Paraboloid maps always split triangles nearer than this, in lengths of their edges, however small the map is."""


@dataclass(frozen=True)
class MapParams:
    """Parameters of shadow maps."""

    spot_size: int = param(2048, lo=16, hi=16384, doc="Width and height of the spotlight's map, texels.")
    vpl_size: int = param(256, lo=16, hi=4096, doc="Width and height of a VPL's map, texels.")
    projection: Literal["perspective", "paraboloid"] = param(
        "perspective",
        doc="Projection of the VPLs' maps. The spotlight's map is a paraboloid if its cone is wider than 140 degrees.",
    )
    bend: float = param(
        2.0,
        lo=0.1,
        hi=16.0,
        doc="Paraboloid maps: split edges that may deviate from their true curve by more than this, texels.",
    )
    tessellation: Literal["adaptive", "pre"] = param(
        "adaptive",
        doc="Paraboloid maps of VPLs: adaptive splits bent edges in each map; pre draws a mesh of short edges.",
    )
    edge: float = param(0.05, lo=1e-4, hi=1.0, doc="Longest edge of that mesh, as a fraction of the scene's diagonal.")
    vpl_deviation: float = param(
        0.0,
        lo=0.0,
        hi=16.0,
        doc="Level of detail in VPLs' maps: largest deviation, in texels in the middle of the map. 0: the full scene.",
    )
    cull: Literal["none", "front"] = param(
        "none", doc="front: draw only back faces, which moves the bias to the unlit side; for closed meshes."
    )
    budget: int = param(1280, lo=1, hi=65536, doc="Memory limit for the maps, MiB.")

    def check_budget(self, vpls: int, nbytes: int, fits: int) -> None:
        """Raise GraphError if maps for `vpls` VPLs exceed the budget, or if parameters contradict each other.

        nbytes: of all maps. fits: how many VPLs would be within the budget.
        """
        if self.vpl_deviation > 0 and self.projection == "paraboloid" and self.tessellation == "pre":
            raise GraphError(
                "shadow_maps.vpl_deviation and shadow_maps.tessellation = 'pre' each draw a mesh of their own; "
                "set vpl_deviation = 0 or tessellation = 'adaptive'"
            )
        if nbytes > self.budget * 2**20:
            if 4 * self.spot_size**2 > self.budget * 2**20:
                raise GraphError(
                    f"the spotlight's map of {self.spot_size}x{self.spot_size} alone needs "
                    f"{4 * self.spot_size**2 // 2**20} MiB, and shadow_maps.budget is {self.budget}; use a smaller "
                    "shadow_maps.spot_size or a larger budget"
                )
            raise GraphError(
                f"maps for {vpls} VPLs of {self.vpl_size}x{self.vpl_size} need {nbytes // 2**20} MiB, and "
                f"shadow_maps.budget is {self.budget}; {max(fits, 0)} VPLs fit, all bounces together; "
                "use fewer, a smaller shadow_maps.vpl_size or a larger budget"
            )

    def check_layers(self, vpls: int, layers: int, tiles: int, first: int) -> None:
        """Raise GraphError if an atlas needs too many layers. tiles: of VPLs on a layer; the `first` ones have none."""
        if layers > MOST_LAYERS:
            raise GraphError(
                f"maps for {vpls} VPLs of {self.vpl_size}x{self.vpl_size} need {layers} layers, and there are "
                f"{MOST_LAYERS}; {max(MOST_LAYERS - first, 0) * tiles} VPLs fit, all bounces together; "
                "use fewer, a smaller shadow_maps.vpl_size or a larger shadow_maps.spot_size"
            )

    def defines(self) -> dict[str, int | float]:
        """Return the defines of shaders that draw maps or read them."""
        return {"VPL_PARABOLOID": int(self.projection == "paraboloid"), "VPL_SIZE": self.vpl_size}

    def tolerance(self, records: np.ndarray) -> Array:
        """Return `vpl_deviation` as a fraction of the distance from each VPL, (n,). records: VPL (n,).

        A texel is widest in the middle of a map.
        """
        widest = 4 * records["curve"] if self.projection == "paraboloid" else 2
        tolerance: Array = self.vpl_deviation * widest * records["tan_half"] / self.vpl_size
        return tolerance

    def reach(self, records: np.ndarray, size: Array | float) -> Array:
        """Return how many of its lengths an edge must be away from a view to bend by less than `bend` texels, (n,).

        records: of views or VPLs (n,). size: of their maps, texels. An edge that subtends an angle a bends by a^2 / 8
        of the hemisphere's radius at most. In small maps that is little, but a triangle has to be smaller than the
        hemisphere, too, to be drawn as it is.
        """
        reach = np.sqrt(np.float64(size) / (16 * records["curve"] * records["tan_half"] * self.bend))
        least: Array = np.maximum(reach, LEAST_REACH)
        return least

    def prepare(self, gpu: Any) -> None:
        """Set the OpenGL state for drawing maps in reversed depth."""
        ctx = gpu.ctx
        ctx.enable(ctx.DEPTH_TEST)
        ctx.depth_func = ">"
        if self.cull == "front":
            # A map's axes are right, up and into the view, a left-handed frame: OpenGL sees front faces as back faces.
            ctx.enable(ctx.CULL_FACE)
            ctx.cull_face = "back"
