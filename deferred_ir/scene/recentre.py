"""Moves a scene near the origin and splits its huge triangles, so that 32-bit floats hold it.

The GPU and Embree get every scene this way. Both steps are done in 64 bits.
"""

from __future__ import annotations

from dataclasses import replace
from weakref import WeakKeyDictionary

from deferred_ir.scene.geometry import Geometry
from deferred_ir.scene.large_triangles import split_large_triangles
from deferred_ir.scene.scene import Scene

_recentred: WeakKeyDictionary[Geometry, Geometry | None] = WeakKeyDictionary()
"""Results by what they were made from, None where that needs no change: the dictionary must not keep its own keys."""


def recentre(scene: Scene) -> Scene:
    """Return the scene in coordinates about `scene.geometry.centre`, without huge triangles; itself if it is so.

    Camera and lights rest where they are.
    """
    geometry = recentre_geometry(scene.geometry)
    if geometry is scene.geometry:
        return scene
    x, y, z = scene.geometry.centre
    by = (-x, -y, -z)
    return replace(
        scene,
        geometry=geometry,
        camera=scene.camera.translate(by),
        lights=tuple(light.translate(by) for light in scene.lights),
    )


def recentre_geometry(geometry: Geometry) -> Geometry:
    """Return the geometry in coordinates about its `centre`, without huge triangles; itself if it is so.

    The same geometry gives the same object every time.
    """
    if geometry not in _recentred:
        result = _recentre_rest(geometry) if geometry.rest is geometry else _recentre_pose(geometry)
        _recentred[geometry] = None if result is geometry else result
    return _recentred[geometry] or geometry


def _recentre_rest(geometry: Geometry) -> Geometry:
    if not any(geometry.centre):
        return split_large_triangles(geometry)
    moving = tuple(
        replace(model, motion=model.motion.shift_origin(geometry.centre)) for model in geometry.moving if model.motion
    )
    medians = geometry.middle - geometry.centre, geometry.spread
    near = replace(geometry, positions=geometry.positions - geometry.centre, moving=moving, medians=medians)
    return split_large_triangles(near)


def _recentre_pose(geometry: Geometry) -> Geometry:
    rest = recentre_geometry(geometry.rest)
    if rest is geometry.rest:
        return geometry
    poses = geometry.poses
    if any(geometry.centre):
        poses = poses.copy()
        poses[:, :3, 3] += poses[:, :3, :3] @ geometry.centre - geometry.centre
    return rest.pose(poses)
