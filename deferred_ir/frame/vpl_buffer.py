"""VPLs on the GPU: a record for each."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from deferred_ir.base.arrays import Array, Bools, Ints
from deferred_ir.base.versions import new_versions
from deferred_ir.frame.vpl_params import VplParams
from deferred_ir.gl.buffers import GpuBuffer
from deferred_ir.graph.ports import Buffer, Description, Output
from deferred_ir.sampling.warps import build_basis
from deferred_ir.scene.geometry import Geometry
from deferred_ir.scene.lights.spotlight import one_minus_cos
from deferred_ir.scene.scene import Scene
from deferred_ir.vpls.cast import Vpls
from deferred_ir.vpls.kernel import VplLimits
from deferred_ir.vpls.sample_lights import PointSet

VPL = np.dtype(
    [
        ("position", "f4", 3),
        ("one_minus_cos", "f4"),  # 1 - cos of the half cone angle, without cancellation
        ("x_axis", "f4", 3),  # right and up, divided by tan(half angle): NDC = dot(d, axis) / dot(d, z_axis)
        ("tan_half", "f4"),
        ("y_axis", "f4", 3),
        ("clamp_squared", "f4"),  # 1/d^2 is taken as 1/max(d^2, this)
        ("z_axis", "f4", 3),  # unit; the normal of its surface
        ("tile", "f4"),  # of the shadow atlas
        ("emission", "f4", 3),
        ("curve", "f4"),  # c / (1 + c), c the cosine of the half cone angle: scales paraboloid maps
    ]
)
"""One VPL in a std140 uniform block; shaders/lib/lights/vpl.glsl declares the same five vec4. It is its own view."""

BINDING = 1
VPLS_PER_BLOCK = 192
"""VPLs in a uniform block: OpenGL promises 16 KiB (204 VPLs), and blocks must start at multiples of 256 bytes."""

HEMISPHERE = 1.0
"""1 - cos of the half cone angle of points of lights, which shine into the whole hemisphere."""
POINT_FOV = 179.9
"""Opening angle of their maps, degrees."""
MARGIN = 1.001
"""By which a parallel view is larger than the scene's bounds."""

ROUNDINGS = 8
"""Distance between a VPL and its surface, in roundings of a 32-bit coordinate: positions and products are rounded."""


@dataclass(frozen=True)
class VplsMeta:
    """What is known of a buffer of VPLs before it is filled.

    params: parameters of the VPLs. bounces: most diffuse bounces of a path that makes one. points: room for points of
    lights, whose tiles come first.
    """

    params: VplParams
    bounces: int
    points: int = 0


def describe_output(params: VplParams, bounces: int = 1, points: Description | None = None) -> Output:
    """Return the port of a buffer with room for `points` of lights, if any, and `params.count` VPLs of each bounce."""
    first = points.records if isinstance(points, Buffer) else 0
    vpls = Buffer("vpl", first + params.count * bounces, VPL.itemsize, VPLS_PER_BLOCK, binding=BINDING)
    return Output("VPLs in the order of their tiles", vpls, DEFINES, meta=VplsMeta(params, bounces, first))


DEFINES = {"VPLS_BINDING": BINDING, "VPLS_PER_BLOCK": VPLS_PER_BLOCK}
"""Defines for the shaders that read a buffer of VPLs."""


def pack_vpls(scene: Scene, vpls: Vpls, params: VplParams, tiles: Ints) -> np.ndarray:
    """Return VPL records (n,). tiles: int (n,), of their maps in the atlas."""
    records = np.zeros(len(vpls), VPL)
    records["position"] = lift_off_surface(scene, vpls.position, vpls.normal)
    records["emission"], records["tile"] = vpls.emission, tiles
    records["clamp_squared"] = (params.clamp_fraction * scene.geometry.diagonal) ** 2
    records["one_minus_cos"] = one_minus_cos(params.fov)
    fill_view(records, vpls.normal, params.fov)
    return records


def pack_points(scene: Scene, points: PointSet) -> np.ndarray:
    """Return VPL records (n,) of points of lights, in tiles 0, 1, ...: not clamped, into the whole hemisphere."""
    records, bounds = np.zeros(len(points), VPL), scene.bounds
    records["position"] = lift_off_surface(scene, points.position, points.normal)
    records["emission"], records["tile"] = points.emission, np.arange(len(points))
    records["one_minus_cos"] = HEMISPHERE
    fill_view(records, points.normal, POINT_FOV)
    rows = np.flatnonzero(points.parallel)
    if len(rows):
        parallel = records[rows]
        reach = bounds.radius * MARGIN
        parallel["position"] = np.asarray(bounds.centre) - points.normal[rows] * reach
        fill_parallel_view(parallel, points.normal[rows], reach, 2 * reach)
        records[rows] = parallel
    return records


def join_vpls(points: GpuBuffer | None, vpls: np.ndarray) -> np.ndarray:
    """Return the records of points of lights, if there are any, and of VPLs (n,), in tiles behind those."""
    if points is None:
        return vpls
    vpls = vpls.copy()
    vpls["tile"] += points.description.records
    return np.concatenate([points.records, vpls]) if len(points.records) else vpls


def bring_near(records: np.ndarray, distance: float) -> np.ndarray:
    """Return VPL records (n,) with those at infinity as lights at a `distance` that is the same everywhere.

    So all emissions have one unit. clamp_squared says which they are: minus the square of the distance.
    """
    near = records.copy()
    rows = records["tan_half"] == 0
    near["emission"][rows] *= np.float32(distance**2)
    near["clamp_squared"][rows] = -(distance**2)
    return near


def fill_view(records: np.ndarray, axis: Array, fov: float) -> None:
    """Fill the axes and scales of views along unit `axis` (n, 3) into records (n,); fov: full angle, degrees."""
    half = math.radians(fov) / 2
    cosine = math.cos(half)
    records["x_axis"], records["y_axis"], records["z_axis"] = make_axes(axis, fov)
    records["tan_half"], records["curve"] = math.tan(half), cosine / (1 + cosine)


def fill_parallel_view(records: np.ndarray, axis: Array, reach: float, depth: float) -> None:
    """Fill the axes and scales of parallel views along unit `axis` (n, 3) into records (n,).

    reach: half the width of the square that they cover. depth: how far they see, world units.
    """
    right, up = build_basis(axis)
    records["x_axis"], records["y_axis"], records["z_axis"] = right / reach, up / reach, axis
    records["tan_half"], records["curve"] = 0, 1 / depth


def make_axes(axis: Array, fov: float) -> tuple[Array, Array, Array]:
    """Return right, up and forward (n, 3) of views along unit `axis` (n, 3), fov degrees wide: x_axis, y_axis, z_axis.

    Right and up are divided by the tangent of half the angle.
    """
    right, up = build_basis(axis)
    tangent = math.tan(math.radians(fov) / 2)
    return right / tangent, up / tangent, axis


def read_vpls(records: np.ndarray) -> Vpls:
    """Return the VPLs of VPL records (n,), positions and normals in the records' single precision."""
    emission = records["emission"].astype(float)
    return Vpls(records["position"], records["z_axis"], emission, np.arange(len(records)))


def describe_points(count: int) -> Output:
    """Return the port of a buffer of `count` points of lights."""
    points = Buffer("vpl", count, VPL.itemsize)
    return Output("points that stand for lights which have an area or lie all around", points)


def read_limits(records: np.ndarray) -> VplLimits:
    """Return cone and clamp of the VPLs in VPL records (n,), n > 0, in the precision in which shaders read them.

    Points of lights, which have neither, do not count where there are others.
    """
    others = records[records["one_minus_cos"] < HEMISPHERE]
    records = others if len(others) else records
    return VplLimits(clamp=math.sqrt(records["clamp_squared"][0]), cosine=1 - float(records["one_minus_cos"][0]))


def find_spread(records: np.ndarray) -> float:
    """Return what to add to the squared width of a glossy lobe for each VPL, of VPL records (n,).

    Taken to lie all around, n VPLs are 4 pi / n apart, each the middle of a disc with the radius 2 / sqrt(n); the lobe
    about half vectors gets wider by half of that. It keeps its light: what else would be a spike becomes a spot, which
    the more VPLs, the less differs from the truth.
    """
    return 1.0 / max(int((records["emission"] > 0).any(axis=1).sum()), 1)


def lift_off_surface(scene: Scene, position: Array, normal: Array) -> Array:
    """Return positions (n, 3) of VPLs moved off their surfaces: rounding would draw these into the maps in places."""
    size = np.maximum(np.abs(position).max(axis=1, keepdims=True), scene.geometry.scale)
    lifted: Array = position + normal * (ROUNDINGS * 2.0**-24 * size)
    return lifted


class MapVersions:
    """Versions of the shadow maps that a buffer's lights would have: a light's stays as long as its map would.

    A map shows the same while the models stay and its light keeps pose and shape; how bright that is does not matter.
    """

    def __init__(self) -> None:
        self._geometry: Geometry | None = None
        self._shapes, self._versions = np.zeros((0, VPL.itemsize // 4), np.uint32), np.zeros(0, int)

    def update(self, records: np.ndarray, scene: Scene) -> Ints:
        """Return the versions (n,) of the next frame's lights, VPL records (n,)."""
        lights = records.copy()
        lights["emission"] = lights["clamp_squared"] = 0
        shapes = lights.view(np.uint32).reshape(len(records), VPL.itemsize // 4)
        both = min(len(shapes), len(self._shapes)) if self._geometry is scene.geometry else 0
        same: Bools = np.zeros(len(shapes), bool)
        same[:both] = (shapes[:both] == self._shapes[:both]).all(axis=1)
        versions = new_versions(len(shapes))
        versions[same] = self._versions[:both][same[:both]]
        self._geometry, self._shapes, self._versions = scene.geometry, shapes, versions
        return versions
