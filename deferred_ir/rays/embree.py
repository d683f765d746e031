"""Embree over the triangles of one scene. Moving models have Embree scenes of their own: Embree cannot refit one.

Rays that meet a moving model's box are transformed by the inverse of its pose; hits keep their multiple of the
direction.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from deferred_ir.base.arrays import Array, Bools, Ints
from deferred_ir.base.errors import DeviceError
from deferred_ir.scene.geometry import Geometry
from deferred_ir.scene.vertices import find_middle

INFINITE = 1e37
"""The length that stands for an unbounded ray."""
SLACK = 1e-5
"""A moving model's box is enlarged by this fraction of its size and coordinates, as rays are in 32-bit floats."""


@dataclass(frozen=True)
class _MovingModel:
    """A moving model. box: where it is; turn (3, 3), shift (3,): from world to its own coordinates."""

    embree: Any
    faces: Ints
    box: Array
    turn: Array
    shift: Array

    def transform_rays(self, origins: Array, ways: Array) -> tuple[Array, Array]:
        """Transform rays (n, 3), (n, 3) to its own coordinates, float32."""
        own: Array = origins.astype(np.float64) @ self.turn.T + self.shift
        return own.astype(np.float32), (ways.astype(np.float64) @ self.turn.T).astype(np.float32)

    def find_near(self, origins: Array, ways: Array, reach: Array) -> Ints:
        """Return which rays meet its box within `reach` (n,) lengths of their directions, int (m,)."""
        enter, leave = np.zeros(len(origins), np.float32), reach
        for axis, (low, high) in enumerate(self.box.T.astype(np.float32)):
            origin = origins[:, axis]
            with np.errstate(divide="ignore", invalid="ignore"):
                inverse = 1 / ways[:, axis]
                first, second = (low - origin) * inverse, (high - origin) * inverse
            # A ray in a side's plane gives 0 * inf = NaN, which fmin and fmax ignore.
            enter = np.fmax(enter, np.fmin(first, second))
            leave = np.fmin(leave, np.fmax(first, second))
        return np.flatnonzero(enter <= leave * np.float32(1 + SLACK))


class EmbreeScenes:
    """Embree's scenes of one geometry. Rays are float32 (n, 3); queries are safe from many threads."""

    def __init__(self, geometry: Geometry) -> None:
        self._still = np.flatnonzero(geometry.groups == 0) if geometry.moving else None
        faces = geometry.faces if self._still is None else geometry.faces[self._still]
        self._scene = _build_scene(geometry.positions, faces)
        rest = geometry.rest
        self._centres, self._models = list[Array](), list[Any]()
        for model, own in zip(rest.moving, rest.faces_of_models, strict=True):
            # Relative to its middle, where 32-bit floats are finest.
            at = rest.positions[model.vertices]
            self._centres.append(find_middle(at))
            self._models.append(_build_scene(at - self._centres[-1], rest.faces[own] - model.first_vertex))
        self._moving: list[_MovingModel] = []
        self.pose(geometry)

    def pose(self, geometry: Geometry) -> None:
        """Move the moving models to another pose of the same geometry."""
        self._moving = []
        for i, pose in enumerate(geometry.poses):
            low, high = geometry.boxes[i]
            slack = SLACK * (np.abs([low, high]).max() + np.linalg.norm(high - low))
            turn = pose[:3, :3].T
            shift = -turn @ pose[:3, 3] - self._centres[i]
            faces = geometry.faces_of_models[i]
            self._moving.append(
                _MovingModel(self._models[i], faces, np.stack([low - slack, high + slack]), turn, shift)
            )

    def closest(self, origins: Array, ways: Array, reach: Array | None = None) -> tuple[Ints, Array, Array]:
        """Return the first faces hit, int32 (n,), -1 for none, and barycentric u and v there, float32 (n,).

        reach: (n,) lengths of the directions, None for no end.
        """
        options: dict[str, Any] = {} if reach is None else {"dists": reach.copy()}
        found = self._scene.run(origins, ways, output=1, **options)
        face, u, v = (np.asarray(found[name]) for name in ("primID", "u", "v"))
        if self._still is None:
            return face, u, v
        far, hit = np.asarray(found["tfar"]), face >= 0
        face = face.copy()
        face[hit] = self._still[face[hit]]
        for model in self._moving:
            rows = model.find_near(origins, ways, far)
            if not len(rows):
                continue
            found = model.embree.run(*model.transform_rays(origins[rows], ways[rows]), dists=far[rows], output=1)
            met = np.flatnonzero(np.asarray(found["primID"]) >= 0)
            rows = rows[met]
            face[rows] = model.faces[found["primID"][met]]
            far[rows], u[rows], v[rows] = found["tfar"][met], found["u"][met], found["v"][met]
        return face, u, v

    def occluded(self, origins: Array, ways: Array, reach: Array) -> Bools:
        """Return whether rays hit anything within `reach` (n,) lengths of their directions, bool (n,)."""
        hidden: Bools = np.asarray(self._scene.run(origins, ways, dists=reach.copy(), query="OCCLUDED")) == 0
        for model in self._moving:
            free = np.flatnonzero(~hidden)
            free = free[model.find_near(origins[free], ways[free], reach[free])]
            if len(free):
                rays = model.transform_rays(origins[free], ways[free])
                hidden[free] = np.asarray(model.embree.run(*rays, dists=reach[free], query="OCCLUDED")) == 0
        return hidden


def _build_scene(positions: Array, faces: Ints) -> Any:
    """Build and commit an Embree scene. Raises DeviceError without embreex."""
    try:
        from embreex import rtcore_scene
        from embreex.mesh_construction import TriangleMesh
    except ImportError as error:
        raise DeviceError(
            "embreex: not installed, so no rays can be traced; pip install embreex, "
            "or render with --graph deferred --vpls 0"
        ) from error
    scene = rtcore_scene.EmbreeScene(robust=True)
    TriangleMesh(scene, positions.astype(np.float32), faces.astype(np.int32))
    # The first ray commits Embree's scene, which must not happen in two threads at once.
    scene.run(np.zeros((1, 3), np.float32), np.ones((1, 3), np.float32))
    return scene


def can_trace() -> bool:
    """Return whether Embree finds a triangle: it is a compiled library, so an import alone proves little.

    Raises DeviceError without embreex.
    """
    scene = _build_scene(np.array([[0, 0, 1], [1, 0, 1], [0, 1, 1]]), np.array([[0, 1, 2]]))
    found = scene.run(np.array([[0.2, 0.2, 0]], np.float32), np.array([[0, 0, 1]], np.float32), output=1)
    return bool(found["primID"][0] == 0)
