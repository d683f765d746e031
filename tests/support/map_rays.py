"""Shadow maps texel by texel: what rays from the light through a texel meet."""

from __future__ import annotations

from typing import Any

import numpy as np

from deferred_ir.engine.renderer import Renderer
from deferred_ir.frame.frame import NEAR
from deferred_ir.rays.tracer import Tracer

AROUND = [(x, y) for y in (-1, 0, 1) for x in (-1, 0, 1)]
CENTRE = AROUND.index((0, 0))
START = 1e-6
"""How far in front of a light rays start, in scales of the scene."""
CLOSEST = NEAR / (100 * START)
"""Depth at a hundred times that distance."""


def tiles(one: Renderer, count: int) -> list[np.ndarray]:
    """The maps of the first `count` VPLs of the frame drawn last, each (n, n), lowest row first."""
    with one.gpu.ctx:
        atlas = one.executor.resource(("shadow_maps", "atlas")).read()[..., 0]
    size = one.graph().nodes["shadow_maps"].work.params.vpl_size
    row = atlas.shape[1] // size
    layers = atlas[1:, : row * size, : row * size].reshape(-1, row, size, row, size)
    return list(layers.transpose(0, 1, 3, 2, 4).reshape(-1, size, size)[:count])


def directions(record: Any, size: int, projection: str, texels: tuple[float, float] = (0.0, 0.0)) -> np.ndarray:
    """Unit directions (size, size, 3) through the texels of a light's map, `texels` to the right and up of centres."""
    x, y = np.meshgrid(*((np.arange(size) + 0.5 + off) / size * 2 - 1 for off in texels))
    tangent = float(record["tan_half"])
    right, up, z = (record[axis].astype(float) for axis in ("x_axis", "y_axis", "z_axis"))
    if projection == "perspective":
        way = (x[..., None] * right + y[..., None] * up) * tangent**2 + z
        return way / np.linalg.norm(way, axis=-1, keepdims=True)
    # Stereographic: the radius is the tangent of half the angle.
    scale = float(record["curve"]) * tangent
    x, y = x * scale, y * scale
    square = (x * x + y * y)[..., None]
    return (2 * tangent * (x[..., None] * right + y[..., None] * up) + (1 - square) * z) / (1 + square)


def start(tracer: Tracer, record: Any) -> np.ndarray:
    """A bit in front of a light, (3,), so that rays do not meet the surface on which it may lie."""
    return record["position"] + START * tracer.scene.geometry.scale * record["z_axis"].astype(float)


def depths(tracer: Tracer, record: Any, way: np.ndarray, projection: str) -> np.ndarray:
    """Depth of what rays along `way` (..., 3) from the light meet, 0 where they miss."""
    near = NEAR * tracer.scene.geometry.scale
    z, position = record["z_axis"].astype(float), record["position"].astype(float)
    rays = way.reshape(-1, 3)
    hits = tracer.closest(np.broadcast_to(start(tracer, record), rays.shape), rays)
    from_light = hits.position - position
    away = from_light @ z if projection == "perspective" else np.linalg.norm(from_light, axis=1)
    depth = np.zeros(len(rays))
    depth[hits.hit] = near / np.maximum(away[hits.hit], near)
    return depth.reshape(way.shape[:-1])


def through_light(tracer: Tracer, record: Any, way: np.ndarray) -> np.ndarray:
    """Whether rays along `way` (..., 3) meet faces in whose plane the light lies, bool (...)."""
    geometry, position = tracer.scene.geometry, record["position"].astype(float)
    rays = way.reshape(-1, 3)
    face = tracer.closest(np.broadcast_to(start(tracer, record), rays.shape), rays).face
    away = ((position - geometry.positions[geometry.faces[:, 0]]) * geometry.face_normals).sum(axis=1)
    within = np.abs(away) < 1e-6 * geometry.diagonal
    return ((face >= 0) & within[face]).reshape(way.shape[:-1])


def wrong_texels(tracer: Tracer, record: Any, tile: np.ndarray, projection: str) -> np.ndarray:
    """Which texels of a map (n, n) are off by 2 % from all that nine rays meet, up to a texel from their centre.

    So silhouettes do not count. Nor does what is so close that it matters where rays start, or as close to the light's
    own plane; nor a surface that goes through the light itself, of which only the rays, which start in front, see much.
    """
    ways = np.array([directions(record, len(tile), projection, off) for off in AROUND])
    true = depths(tracer, record, ways, projection)
    cosine = ways[CENTRE] @ record["z_axis"].astype(float)
    told = (cosine > 0.02) & (true.max(axis=0) < CLOSEST * (1.0 if projection == "perspective" else cosine))
    told &= ~through_light(tracer, record, ways).any(axis=0)
    return told & ((tile > 1.02 * true.max(axis=0)) | (tile < 0.98 * true.min(axis=0)))
