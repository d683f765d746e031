"""Facts of scene, frame size and device that planning may know. Passes' own facts stand beside what they are about."""

from __future__ import annotations

from collections.abc import Sequence

from deferred_ir.frame.direct_lights import has_maps
from deferred_ir.graph.facts import Fact, Facts
from deferred_ir.scene.scene import Scene

EMITS = Fact("emits", unknown=True, doc="A light shines.", needs=True)
TRIANGLES = Fact("triangles", unknown=0, doc="Triangles of the scene.")
PIXELS = Fact("pixels", unknown=512 * 512, doc="Pixels of a frame.")
SOFT = Fact("soft", unknown=False, doc="A direct light has an area: its shadows are soft.")
DIRECT_LIGHTS = Fact("direct_lights", unknown=1, doc="Lights that shaders evaluate, on or off.")
VIEWS = Fact[Sequence[int]](
    "views", unknown=(0,), doc="Of each shadow map of direct lights, how often its edge is halved."
)
SAMPLED = Fact("sampled", unknown=True, doc="Lights shine for which points stand.")
ENVIRONMENT = Fact[tuple[int, int] | None](
    "environment",
    unknown=(1, 1),
    doc="Size of the image of light from all around; None without.",
)
EMISSION = Fact("emission", unknown=True, doc="Surfaces are seen to emit.")
GLOSS = Fact("gloss", unknown=True, doc="Surfaces are glossy.")
BLURRED_GLOSS = (
    "VPLs are spots in gloss, which blurs what they stand for; none comes from gloss to matt surfaces (caustics)"
)
"""The error of pictures whose gloss shows VPLs."""
SOFTWARE = Fact("software", unknown=True, doc="OpenGL draws on the CPU.")


def explain_no_gloss(facts: Facts) -> str | None:
    """Return why a pass that works on reflections is not needed; None if there may be any."""
    if not facts[GLOSS]:
        return "no surface is glossy"
    return None if facts[EMITS] else "nothing shines"


def collect_facts(scene: Scene, size: tuple[int, int] | None = None, *, software: bool | None = None) -> Facts:
    """Return what planning may know of `scene` and, where they are given, of the frame's size and the device."""
    direct = scene.direct_lights
    facts = Facts(
        {
            EMITS: scene.emits,
            SOFT: any(light.has_area for light in direct),
            DIRECT_LIGHTS: len(direct),
            VIEWS: tuple(x for light in direct if has_maps(light, direct) for x in light.view_halvings),
            SAMPLED: bool(scene.sampled_lights),
            ENVIRONMENT: scene.environment.size if scene.environment else None,
            EMISSION: scene.shows_emission,
            GLOSS: scene.has_gloss,
            TRIANGLES: len(scene.geometry.faces),
        }
    )
    if size is not None:
        facts = facts.add({PIXELS: size[0] * size[1]})
    return facts if software is None else facts.add({SOFTWARE: software})
