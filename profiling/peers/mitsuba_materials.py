"""Conversion of materials to Mitsuba's BSDFs.

A metal is `principled`, which is our model there to the last digit: GGX, separable shadowing, Schlick. Of what has a
coat it is not: its diffuse part has Burley's retro-reflection, brighter by up to a fifth for rough surfaces, and the
coat a dielectric's exact Fresnel term.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from deferred_ir.base.arrays import Array
from deferred_ir.profiling.peers.mitsuba_lights import make_bitmap
from deferred_ir.profiling.peers.peer import decode, find_numbers
from deferred_ir.scene.scene import Scene
from deferred_ir.scene.surfaces.brdf import find_head_on
from deferred_ir.scene.surfaces.materials import Material, TextureRef

FULL = 0.08
"""Reflectance head-on that `principled` has at specular 1."""
LEAST = 1e-4
"""Least specular: at 0 `principled` reflects nothing, not even where it is metal."""


def describe_material(mi: Any, scene: Scene, material: Material, albedo: Array, colors: Array | None) -> dict[str, Any]:
    """Return a BSDF. albedo: (3,), its base colour; colors: those of its vertices, which multiply it, or None."""
    if colors is not None:
        color: dict[str, Any] = {"type": "mesh_attribute", "name": "vertex_color"}
    else:
        color = describe_image(mi, scene, material.base_color_texture, albedo)
    if not material.is_glossy:
        return {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": color}}
    head_on = float(np.mean(find_head_on(material))) * material.specular
    numbers = {"roughness": material.roughness, "metallic": material.metallic}
    image = find_numbers(scene, material)
    if image is not None:
        parts = {name: make_bitmap(mi, image[..., i : i + 1] * numbers[name]) for i, name in enumerate(numbers)}
        return _principled(color, head_on, **parts)
    return _principled(color, head_on, **numbers)


def _principled(color: dict[str, Any], head_on: float, **parts: Any) -> dict[str, Any]:
    inner = {"type": "principled", "base_color": color, "specular": min(max(head_on / FULL, LEAST), 1.0), **parts}
    return {"type": "twosided", "bsdf": inner}


def describe_image(mi: Any, scene: Scene, image: TextureRef | None, factor: Array) -> dict[str, Any]:
    """Return `factor` (3,) times a texture of the scene, if there is one."""
    if image is None or scene.geometry.uvs is None:
        return {"type": "rgb", "value": factor.tolist()}
    # Linear before filtering, as ours; the filter is linear, so the factor can be in its pixels.
    return make_bitmap(mi, decode(scene.textures[image.number]) * factor.astype(np.float32))
