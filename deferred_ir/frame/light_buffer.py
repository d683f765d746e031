"""The light buffer: the spotlight's record and then one for each VPL."""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt

import numpy as np

from deferred_ir.base.arrays import Array, Bools, Ints
from deferred_ir.base.versions import new_versions
from deferred_ir.frame.vpl_params import VplParams
from deferred_ir.graph.ports import Buffer, Output
from deferred_ir.scene.geometry import Geometry
from deferred_ir.scene.lights.spot import LIGHT, LIGHTS_PER_BLOCK, SPOT_TILE, fill_records
from deferred_ir.scene.scene import Scene
from deferred_ir.vpls.cast import Vpls
from deferred_ir.vpls.kernel import VplLimits

ROUNDINGS = 8
"""Of a coordinate: what a VPL's surface and its map may be apart by, with positions and their products rounded."""


@dataclass(frozen=True)
class LightsMeta:
    """What is known of a light buffer before it is filled. bounces: most diffuse bounces of a path that makes a VPL."""

    bounces: int


def output(vpls: int, bounces: int = 1) -> Output:
    """The port of a buffer with room for the spotlight and `vpls` VPLs."""
    records = Buffer("light", 1 + vpls, LIGHT.itemsize, LIGHTS_PER_BLOCK)
    defines = {"LIGHTS_PER_BLOCK": LIGHTS_PER_BLOCK}
    return Output("the spotlight, then the VPLs", records, defines, meta=LightsMeta(bounces))


def packed(scene: Scene, vpls: Vpls, params: VplParams, tiles: Ints) -> np.ndarray:
    """LIGHT records (1 + n,) of the scene's spotlight and n VPLs; tiles: int (n,), of their maps in the atlas."""
    light = scene.spotlight
    position = off_surface(scene, vpls.position, vpls.normal)
    records = np.zeros(1 + len(vpls), LIGHT)
    spot = np.array([light.position]), light.axis[None], np.array([light.emission])
    fill_records(records[:1], *spot, fov=light.fov, tile=SPOT_TILE)
    fill_records(records[1:], position, vpls.normal, vpls.emission, fov=params.fov, tile=tiles.astype("f4"))
    records["clamp_squared"][0] = light.radius
    records["clamp_squared"][1:] = (params.clamp_fraction * scene.geometry.diagonal) ** 2
    return records


def read_vpls(records: np.ndarray) -> Vpls:
    """Return the VPLs of LIGHT records (n,), positions and normals in the records' single precision."""
    emission = records["emission"].astype(float)
    return Vpls(records["position"], records["z_axis"], emission, np.arange(len(records)))


def read_limits(records: np.ndarray) -> VplLimits:
    """Return cone and clamp of the VPLs in LIGHT records (n,), n > 0, in the precision in which shaders read them."""
    return VplLimits(clamp=sqrt(records["clamp_squared"][0]), cosine=1 - float(records["one_minus_cos"][0]))


def off_surface(scene: Scene, position: Array, normal: Array) -> Array:
    """Where VPLs stand, (n, 3): off their surfaces by its roundings, or their maps would show these here and there."""
    size = np.maximum(np.abs(position).max(axis=1, keepdims=True), scene.geometry.scale)
    lifted: Array = position + normal * (ROUNDINGS * 2.0**-24 * size)
    return lifted


class MapVersions:
    """Versions of the shadow maps that a buffer's lights would have: a light's stays as long as its map would.

    A map shows the same while the models stay and its light keeps pose and shape; how bright that is does not matter.
    """

    def __init__(self) -> None:
        self._geometry: Geometry | None = None
        self._shapes, self._versions = np.zeros((0, LIGHT.itemsize // 4), np.uint32), np.zeros(0, int)

    def update(self, records: np.ndarray, scene: Scene) -> Ints:
        """Return the versions (n,) of the next frame's lights, LIGHT records (n,)."""
        lights = records.copy()
        lights["emission"] = lights["clamp_squared"] = 0
        shapes = lights.view(np.uint32).reshape(len(records), -1)
        both = min(len(shapes), len(self._shapes)) if self._geometry is scene.geometry else 0
        same: Bools = np.zeros(len(shapes), bool)
        same[:both] = (shapes[:both] == self._shapes[:both]).all(axis=1)
        versions = new_versions(len(shapes))
        versions[same] = self._versions[:both][same[:both]]
        self._geometry, self._shapes, self._versions = scene.geometry, shapes, versions
        return versions
