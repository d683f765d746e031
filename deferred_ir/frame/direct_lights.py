"""Direct lights on the GPU: a record for each light of the scene, and which of their shadow maps stay."""

from __future__ import annotations

import numpy as np

from deferred_ir.base.arrays import Ints
from deferred_ir.base.versions import new_versions
from deferred_ir.graph.ports import Buffer, Output
from deferred_ir.scene.scene import Scene
from deferred_ir.vpls.stale_maps import ModelMoves

LIGHT = np.dtype(
    [
        ("position", "f4", 3),
        ("one_minus_cos", "f4"),  # 1 - cos of the half cone angle, without cancellation
        ("axis", "f4", 3),  # unit; where the light shines
        ("radius", "f4"),  # of its disc
        ("emission", "f4", 3),
        ("view", "f4"),  # number of its first view in the buffer of views
    ]
)
"""One direct light in a std140 uniform block; shaders/lib/lights/direct.glsl declares the same three vec4."""

BINDING = 2
CAPACITY = 1
"""Lights that a scene can have."""


def describe_output() -> Output:
    """Return the port of a buffer with room for the lights of any scene."""
    lights = Buffer("light", CAPACITY, LIGHT.itemsize, block=CAPACITY, binding=BINDING)
    return Output("the direct lights", lights, {"LIGHTS_BINDING": BINDING, "LIGHTS_PER_BLOCK": CAPACITY})


def pack_lights(scene: Scene) -> np.ndarray:
    """Return LIGHT records (n,) of the scene's lights."""
    records, owners = np.zeros(len(scene.direct_lights), LIGHT), find_view_owners(scene)
    records["view"] = np.searchsorted(owners, np.arange(len(records)))
    for record, light in zip(records, scene.direct_lights, strict=True):
        for name, value in light.describe().items():
            record[name] = value
    return records


def find_view_owners(scene: Scene) -> Ints:
    """Return for each view of the scene's lights the number of its light, ascending, int (views,)."""
    return np.repeat(
        np.arange(len(scene.direct_lights)), [len(light.list_views(scene.bounds)) for light in scene.direct_lights]
    )


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
        self._moves.follow(scene.geometry)
        versions = new_versions(len(records))
        if len(shapes) == len(self._shapes):
            stays = (shapes == self._shapes).all(axis=1) & ~self._moves.find_changed(
                records["position"], records["axis"]
            )
            versions[stays] = self._versions[stays]
        self._shapes, self._versions = shapes, versions
        return versions
