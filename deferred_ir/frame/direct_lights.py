"""Direct lights on the GPU: a record for each light of the scene, and which of their shadow maps stay.

Shaders read them a block at a time, with the views of the same lights in a block of views (shadows/views.py).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from deferred_ir.base.arrays import Ints
from deferred_ir.base.versions import new_versions
from deferred_ir.graph.ports import Buffer, Output, Texture
from deferred_ir.scene.lights.base import DirectLight, LightView, is_direct
from deferred_ir.scene.lights.kinds import find_kinds
from deferred_ir.scene.scene import Scene
from deferred_ir.vpls.stale_maps import ModelMoves

LIGHT = np.dtype(
    [
        ("position", "f4", 3),
        ("one_minus_cos", "f4"),  # 1 - cos of the half cone angle, without cancellation
        ("axis", "f4", 3),  # unit; where the light shines, 0 if all around
        ("radius", "f4"),  # of its disc or ball; of one at infinity the tangent of half its angle
        ("emission", "f4", 3),
        ("view", "f4"),  # number of its first view in its block of views
        ("kind", "f4"),  # number of its kind among those of `list_kinds`
        ("views", "f4"),  # how many it has
        ("soft_edge", "f4"),  # 1 - cos over which a spot's edge falls
        ("unused", "f4"),
    ]
)
"""One direct light in a std140 uniform block; shaders/lib/lights/direct.glsl declares the same four vec4."""

BINDING = 2
LIGHTS_PER_BLOCK = 32
"""Lights in a uniform block, of scenes with more than these."""
VIEWS_PER_LIGHT = 6
"""Most views of a light, the faces of a cube."""
VIEWS_PER_BLOCK = LIGHTS_PER_BLOCK * VIEWS_PER_LIGHT
"""Views in a uniform block: those of LIGHTS_PER_BLOCK lights; blocks start at multiples of 256 bytes."""


def describe_output(count: int) -> Output:
    """Return the port of a buffer with room for `count` lights."""
    block = min(max(count, 1), LIGHTS_PER_BLOCK)
    lights = Buffer("light", -(-max(count, 1) // block) * block, LIGHT.itemsize, block=block, binding=BINDING)
    return Output("the direct lights", lights, {"LIGHTS_BINDING": BINDING, "LIGHTS_PER_BLOCK": block})


def describe_direct(count: int) -> Output:
    """Return the port of a texture of the light of `count` direct lights by rays, shadows included.

    Of an only light it holds the irradiance over emission, which takes a quarter of the memory.
    """
    only = count <= 1
    what = "irradiance from the direct light over its emission" if only else "irradiance from the direct lights"
    texture = Texture("r32f" if only else "rgba32f")
    doc = f"{what}, shadows included; 0 on the background"
    return Output(doc, texture, {"DIRECT_OVER_EMISSION": int(only)}, attach=False)


def list_kinds(scene: Scene, *, every: bool = False) -> list[str]:
    """Return the kinds of the scene's direct lights, or every kind that there is; a light's `kind` counts in these."""
    here = {light.kind for light in scene.direct_lights}
    return [kind for kind, light in find_kinds().items() if (every or kind in here) and is_direct(light)]


@dataclass(frozen=True, eq=False)
class DescribedViews:
    """The views of a scene's direct lights in order. owners: int (n,), the number of each view's light, ascending.

    rows: int (n,), of each view's record in the buffer of views.
    """

    views: Sequence[LightView]
    owners: Ints
    rows: Ints


def has_maps(light: DirectLight, lights: Sequence[DirectLight]) -> bool:
    """Return whether one of the direct `lights` gets shadow maps: not if it is off beside others."""
    return len(lights) == 1 or any(light.emission)


def describe_views(scene: Scene) -> DescribedViews:
    """Return the views of the scene's direct lights."""
    lights = scene.direct_lights
    by_light = [light.list_views(scene.bounds) if has_maps(light, lights) else () for light in lights]
    owners: Ints = np.repeat(np.arange(len(by_light)), [len(views) for views in by_light])
    block = owners // LIGHTS_PER_BLOCK
    first = np.searchsorted(block, block)  # of the views of its block
    rows = block * VIEWS_PER_BLOCK + np.arange(len(owners)) - first
    return DescribedViews([view for views in by_light for view in views], owners, rows)


def pack_lights(scene: Scene, described: DescribedViews, kinds: Sequence[str]) -> np.ndarray:
    """Return LIGHT records (n,) of the scene's direct lights, of kinds that are among `kinds`."""
    lights = scene.direct_lights
    records, numbers = np.zeros(len(lights), LIGHT), {kind: number for number, kind in enumerate(kinds)}
    first = np.searchsorted(described.owners, np.arange(len(lights)))
    records["views"] = np.bincount(described.owners, minlength=len(lights))
    has = records["views"] > 0
    records["view"][has] = described.rows[first[has]] % VIEWS_PER_BLOCK
    for record, light in zip(records, lights, strict=True):
        record["kind"] = numbers[light.kind]
        for name, value in light.describe().items():
            record[name] = value
    return records


class LightVersions:
    """Versions of the lights' shadow maps: a light's stays as long as its map would.

    That is while the light keeps pose and cone, and no model moves in front of it; how bright it is does not matter.
    """

    def __init__(self) -> None:
        self._moves = ModelMoves()
        self._shapes, self._versions = np.zeros((0, LIGHT.itemsize // 4), np.uint32), np.zeros(0, int)

    def update(self, records: np.ndarray, scene: Scene) -> Ints:
        """Return the versions (n,) of the next frame's lights, LIGHT records (n,)."""
        lights = records.copy()
        lights["emission"] = lights["radius"] = 0
        shapes = lights.view(np.uint32).reshape(len(records), LIGHT.itemsize // 4)
        moved = bool(self._moves.follow(scene.geometry))
        versions = new_versions(len(records))
        if len(shapes) == len(self._shapes):
            # A light without a cone, which shines all around or from infinity, has every model before it.
            around = (records["one_minus_cos"] == 0) & moved
            changed = self._moves.find_changed(records["position"], records["axis"]) | around
            stays = (shapes == self._shapes).all(axis=1) & ~changed
            versions[stays] = self._versions[stays]
        self._shapes, self._versions = shapes, versions
        return versions
