"""Passes of the user's own that stand in for `vpl` and `lights`: VPLs of the test's choosing, and a dark spotlight."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from deferred_ir.engine.renderer import Renderer
from deferred_ir.frame.direct_lights import describe_views, list_kinds, pack_lights
from deferred_ir.frame.vpl_buffer import BINDING, DEFINES, VPL, VPLS_PER_BLOCK, VplParams, VplsMeta, fill_view
from deferred_ir.graph.pass_base import Pass
from deferred_ir.graph.ports import Buffer, Output
from deferred_ir.passes.lights import Lights
from deferred_ir.scene.lights.spotlight import one_minus_cos


def pack(scene):
    return pack_lights(scene, describe_views(scene), list_kinds(scene))


def fixed_vpls(records: np.ndarray) -> type[Pass]:
    """A pass type that writes these records."""

    class FixedVpls(Pass):
        def outputs(self, inputs: Any) -> dict[str, Output]:
            description = Buffer("vpl", len(records), VPL.itemsize, VPLS_PER_BLOCK, binding=BINDING)
            return {"vpls": Output("VPLs", description, DEFINES, meta=VplsMeta(VplParams(), 1))}

        def execute(self, frame: Any, io: Any) -> None:
            io["vpls"].write(records)

    return FixedVpls


class DarkLights(Lights):
    """The lights of the scene without their power; planning takes the scene for lit."""

    def execute(self, frame: Any, io: Any) -> None:
        records = pack(frame.scene)
        records["emission"] = 0
        io["lights"].write(records)


def vpl_records(position: Any, normal: Any, emission: Any, *, fov: float = 150.0, clamp: float = 0.0) -> np.ndarray:
    """Records of VPLs; `clamp` is a distance."""
    axis = np.asarray(normal, float)
    records = np.zeros(len(axis), VPL)
    records["position"], records["emission"] = position, emission
    records["one_minus_cos"], records["clamp_squared"] = one_minus_cos(fov), clamp**2
    records["tile"] = np.arange(len(axis))
    fill_view(records, axis / np.linalg.norm(axis, axis=1, keepdims=True), fov)
    return records


def lit_by(
    make: Callable[..., Renderer],
    folder: Path,
    vpls: np.ndarray,
    size: tuple[int, int],
    graph: str,
    *,
    dark: bool = False,
    **options: Any,
) -> Renderer:
    """A Renderer of a built-in graph with these VPLs. `make` is the fixture `renderer`; dark: the spotlight is off."""
    path = folder / f"fixed_{graph}.toml"
    lights = '[passes.lights]\ntype = "dark_lights"\n' if dark else ""
    path.write_text(f'extends = "{graph}"\n[passes.vpl]\ntype = "fixed_vpls"\n{lights}', encoding="utf-8")
    return make(size, path, passes={"fixed_vpls": fixed_vpls(vpls), "dark_lights": DarkLights}, **options)
