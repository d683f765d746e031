"""Trace what glossy surfaces reflect: G-buffer, vpls -> reflections.

The G-buffer is read back, Embree traces on the CPU, and the reflections go up, over the share that a surface reflects:
so they can be filtered over a surface whose colour changes from pixel to pixel.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from deferred_ir.base.arrays import Array
from deferred_ir.frame.facts import explain_no_gloss
from deferred_ir.frame.frame import Frame
from deferred_ir.frame.pass_io import Io
from deferred_ir.graph.facts import Facts
from deferred_ir.graph.figures import Figure
from deferred_ir.graph.params import param
from deferred_ir.graph.pass_base import Pass
from deferred_ir.graph.ports import Description, Input, Output, Texture
from deferred_ir.pool.effort import accept_effort, read_effort
from deferred_ir.pool.reflections import GlossyPixels, Reflections
from deferred_ir.pool.samples import read_layout
from deferred_ir.pool.traced_pixels import choose_traced
from deferred_ir.pool.vpl_choice import VplChoice
from deferred_ir.scene.scene import Scene
from deferred_ir.scene.surfaces.brdf import make_gloss

RAYS = Figure("reflection_rays", "Rays from glossy surfaces.", ("reflection_rays",))


@dataclass(frozen=True)
class Params:
    """Parameters of reflections."""

    rays: int = param(1, lo=1, hi=64, doc="Rays a glossy pixel.")


class ReflectionRays(Pass):
    """What glossy surfaces reflect, unfiltered: right in the mean over seeds."""

    Params = Params
    figures = (RAYS,)
    inputs: ClassVar[Mapping[str, Input]] = {
        "depth": Input("reversed depth", format="depth32f"),
        "normals": Input("shading and geometric normal", format="rgba16"),
        "albedo": Input("base colour", format="rgba16f"),
        "material": Input("roughness, metallic and material", format="rgba16", optional=True),
        "vpls": Input("the VPLs, of which each hit asks one", format="vpl"),
        "layout": Input("where samples stand that trace for pixels around them", format="layout", optional=True),
        "blend": Input("what a pixel takes of which samples", format="r32ui", optional=True),
        "effort": accept_effort("factor on `rays`"),
    }

    def outputs(self, inputs: Mapping[str, Description | None]) -> Mapping[str, Output]:
        """Return one texture of the frame's size."""
        del inputs
        doc = (
            "reflected radiance over the share that is reflected; alpha: distance to what it shows, 0 without gloss, "
            "below 0 where samples stand for it"
        )
        return {"reflections": Output(doc, Texture("rgba32f"), attach=False, transient=True)}

    def unneeded(self, facts: Facts) -> str | None:
        """Leave the pass out where nothing is glossy or nothing shines."""
        return explain_no_gloss(facts)

    def explain_shared_error(self, facts: Facts, inputs: Mapping[str, Description | None]) -> str | None:
        """Say what of light paths is left out."""
        del facts, inputs
        return "none of the light of gloss goes on to matt surfaces (caustics)"

    def depends(self) -> frozenset[str]:
        """What the camera sees, and how the light falls on all of the scene."""
        return frozenset({"camera", "light", "models", "seed"})

    def execute(self, frame: Frame, io: Io) -> None:
        """Read the G-buffer back, trace, upload."""
        width, height = frame.size
        image = np.zeros((height * width, 4), np.float32)
        seen, tracer = frame.read_surfaces(io["depth"], io["normals"]), frame.tracer()
        color, code = (io[port].read().reshape(-1, 4)[seen.pixel] for port in ("albedo", "material"))
        numbers = np.round(code[:, 2:] * 65535).astype(int) @ [1, 65536]
        glossy = np.flatnonzero(_list_glossy(frame.scene)[numbers])
        if io["layout"]:
            roughness = np.full(height * width, -1, np.float32)
            roughness[seen.pixel[glossy]] = code[glossy, 0]
            traced = choose_traced(read_layout(io), io["blend"].read().reshape(-1), roughness)
            image[:, 3] = np.where((roughness >= 0) & ~traced, -1, 0)
            glossy = glossy[traced[seen.pixel[glossy]]]
        seen, color, code = seen.rows(glossy), color[glossy].astype(np.float64), code[glossy].astype(np.float64)
        _, gloss = make_gloss(frame.scene.materials, numbers[glossy], color[:, :3], code[:, 1], code[:, 0])
        to_viewer = np.asarray(frame.scene.camera.position) - seen.position
        to_viewer /= np.linalg.norm(to_viewer, axis=1, keepdims=True)
        reflections = Reflections(
            tracer, VplChoice.from_records(tracer, io["vpls"].records), len(frame.scene.direct_lights) > 1
        )
        count = self.params.rays * read_effort(io.step.descriptions)
        radiance, distance = reflections.trace(GlossyPixels(seen, gloss, to_viewer), count, frame.seed)
        image[seen.pixel, :3] = np.minimum(radiance, np.finfo(np.float32).max)
        image[seen.pixel, 3] = np.minimum(distance, np.finfo(np.float32).max)
        io["reflections"].upload(image.reshape(height, width, 4))
        io.count(RAYS.name, count * len(glossy))


def _list_glossy(scene: Scene) -> Array:
    glossy: Array = np.array([material.is_glossy for material in scene.materials], bool)
    return glossy


PASS = ReflectionRays
