"""A pass of the user's own that stands in for `vpl`: its light records are chosen by the test."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from deferred_ir.engine.renderer import Renderer
from deferred_ir.graph.pass_base import Pass
from deferred_ir.graph.ports import Buffer, Output
from deferred_ir.scene.lights.spot import LIGHT, LIGHTS_PER_BLOCK, SPOT_TILE, light_records
from deferred_ir.scene.scene import Scene


def fixed_lights(records: np.ndarray) -> type[Pass]:
    """A pass type that writes these records."""

    class FixedLights(Pass):
        def outputs(self, inputs: Any) -> dict[str, Output]:
            description = Buffer("light", len(records), LIGHT.itemsize, LIGHTS_PER_BLOCK)
            return {"lights": Output("lights", description, {"LIGHTS_PER_BLOCK": LIGHTS_PER_BLOCK})}

        def execute(self, frame: Any, io: Any) -> None:
            io["lights"].write(records)

    return FixedLights


def spot_record(scene: Scene, emission: tuple[float, float, float] | None = None) -> np.ndarray:
    """The record of the scene's spotlight, shape (1,); its emission may be another."""
    light = scene.spotlight
    shine = np.array([light.emission if emission is None else emission])
    return light_records(np.array([light.position]), light.axis[None], shine, fov=light.fov, tile=SPOT_TILE)


def vpl_records(position: Any, normal: Any, emission: Any, *, fov: float = 150.0, clamp: float = 0.0) -> np.ndarray:
    """Records of VPLs; `clamp` is a distance."""
    axis = np.asarray(normal, float)
    records = light_records(
        np.asarray(position, float),
        axis / np.linalg.norm(axis, axis=1, keepdims=True),
        np.asarray(emission, float),
        fov=fov,
        tile=np.arange(len(axis), dtype=float),
    )
    records["clamp_squared"] = clamp**2
    return records


def lit_by(
    make: Callable[..., Renderer], folder: Path, records: np.ndarray, size: tuple[int, int], graph: str, **options: Any
) -> Renderer:
    """A Renderer of a built-in graph in which these records are all lights. `make` is the fixture `renderer`."""
    path = folder / f"fixed_{graph}.toml"
    path.write_text(f'extends = "{graph}"\n[passes.vpl]\ntype = "fixed_lights"\n', encoding="utf-8")
    return make(size, path, passes={"fixed_lights": fixed_lights(records)}, **options)
