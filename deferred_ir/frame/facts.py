"""Facts of scene, frame size and device that planning may know. Passes' own facts stand beside what they are about."""

from __future__ import annotations

from deferred_ir.graph.facts import Fact, Facts
from deferred_ir.scene.scene import Scene

EMITS = Fact("emits", unknown=True, doc="A light shines.", needs=True)
TRIANGLES = Fact("triangles", unknown=0, doc="Triangles of the scene.")
PIXELS = Fact("pixels", unknown=512 * 512, doc="Pixels of a frame.")
SOFT = Fact("soft", unknown=False, doc="The spotlight is a disc.")
SOFTWARE = Fact("software", unknown=True, doc="OpenGL draws on the CPU.")


def collect_facts(scene: Scene, size: tuple[int, int] | None = None, *, software: bool | None = None) -> Facts:
    """Return what planning may know of `scene` and, where they are given, of the frame's size and the device."""
    facts = Facts(
        {
            EMITS: scene.emits,
            SOFT: any(light.has_area for light in scene.direct_lights),
            TRIANGLES: len(scene.geometry.faces),
        }
    )
    if size is not None:
        facts = facts.add({PIXELS: size[0] * size[1]})
    return facts if software is None else facts.add({SOFTWARE: software})
