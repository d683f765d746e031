"""Embree over the triangles of one scene, whose moving models have a scene each of their own: Embree cannot refit.

Rays are carried into a moving model's rest by the inverse of its pose; where they meet it they meet it at the same
multiple of their direction. Only rays that meet its box are.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from deferred_ir.base.arrays import Array, Bools, Ints
from deferred_ir.base.errors import DeviceError
from deferred_ir.scene.geometry import Geometry, find_middle

INFINITE = 1e37
"""What Embree is told for no end."""
SLACK = 1e-5
"""A moving model's box is wider by this fraction of its size and place: rays come in 32 bits."""


@dataclass(frozen=True)
class _MovingModel:
    """A moving model. centre: of its own coordinates, at rest; turn (3, 3), shift (3,): from the world's into these."""

    embree: Any
    faces: Ints
    box: Array
    turn: Array
    shift: Array

    def carry(self, origins: Array, ways: Array) -> tuple[Array, Array]:
        """Rays (n, 3), (n, 3) in its own coordinates, float32."""
        own: Array = origins.astype(np.float64) @ self.turn.T + self.shift
        return own.astype(np.float32), (ways.astype(np.float64) @ self.turn.T).astype(np.float32)

    def near(self, origins: Array, ways: Array, reach: Array) -> Ints:
        """Which of the rays meet its box within `reach` (n,) lengths of their directions, int (m,)."""
        enter, leave = np.zeros(len(origins), np.float32), reach
        for axis, (low, high) in enumerate(self.box.T.astype(np.float32)):
            origin = origins[:, axis]
            with np.errstate(divide="ignore", invalid="ignore"):
                inverse = 1 / ways[:, axis]
                first, second = (low - origin) * inverse, (high - origin) * inverse
            # A ray in a side's plane gives 0 * inf: fmin and fmax pass over it.
            enter = np.fmax(enter, np.fmin(first, second))
            leave = np.fmin(leave, np.fmax(first, second))
        return np.flatnonzero(enter <= leave * np.float32(1 + SLACK))


class EmbreeScenes:
    """Asks Embree. Origins and directions are float32 (n, 3); safe in many threads."""

    def __init__(self, geometry: Geometry) -> None:
        self._still = np.flatnonzero(geometry.groups == 0) if geometry.moving else None
        faces = geometry.faces if self._still is None else geometry.faces[self._still]
        self._scene = _build_scene(geometry.positions, faces)
        rest = geometry.rest
        self._centres, self._models = list[Array](), list[Any]()
        for model, own in zip(rest.moving, rest.faces_of_models, strict=True):
            # In coordinates about its own middle: 32 bits are finest there.
            at = rest.positions[model.vertices]
            self._centres.append(find_middle(at))
            self._models.append(_build_scene(at - self._centres[-1], rest.faces[own] - model.first_vertex))
        self._bodies: list[_MovingModel] = []
        self.pose(geometry)

    def pose(self, geometry: Geometry) -> None:
        """Go on with the same triangles, posed in another way."""
        self._bodies = []
        for i, pose in enumerate(geometry.poses):
            low, high = geometry.boxes[i]
            slack = SLACK * (np.abs([low, high]).max() + np.linalg.norm(high - low))
            turn = pose[:3, :3].T
            shift = -turn @ pose[:3, 3] - self._centres[i]
            faces = geometry.faces_of_models[i]
            self._bodies.append(
                _MovingModel(self._models[i], faces, np.stack([low - slack, high + slack]), turn, shift)
            )

    def closest(self, origins: Array, ways: Array, reach: Array | None = None) -> tuple[Ints, Array, Array]:
        """First faces met, int32 (n,), -1 for none, and barycentric u and v there, float32 (n,).

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
        for body in self._bodies:
            rows = body.near(origins, ways, far)
            if not len(rows):
                continue
            found = body.embree.run(*body.carry(origins[rows], ways[rows]), dists=far[rows], output=1)
            met = np.flatnonzero(np.asarray(found["primID"]) >= 0)
            rows = rows[met]
            face[rows] = body.faces[found["primID"][met]]
            far[rows], u[rows], v[rows] = found["tfar"][met], found["u"][met], found["v"][met]
        return face, u, v

    def occluded(self, origins: Array, ways: Array, reach: Array) -> Bools:
        """Whether anything is met within `reach` (n,) lengths of the directions, bool (n,)."""
        hidden: Bools = np.asarray(self._scene.run(origins, ways, dists=reach.copy(), query="OCCLUDED")) == 0
        for body in self._bodies:
            free = np.flatnonzero(~hidden)
            free = free[body.near(origins[free], ways[free], reach[free])]
            if len(free):
                carried = body.carry(origins[free], ways[free])
                hidden[free] = np.asarray(body.embree.run(*carried, dists=reach[free], query="OCCLUDED")) == 0
        return hidden


def _build_scene(positions: Array, faces: Ints) -> Any:
    """An Embree scene, committed. Raises DeviceError without embreex."""
    try:
        from embreex import rtcore_scene
        from embreex.mesh_construction import TriangleMesh
    except ImportError as error:
        raise DeviceError(
            "embreex: not installed, so no rays can be traced; pip install embreex, or render with --vpls 0"
        ) from error
    scene = rtcore_scene.EmbreeScene(robust=True)
    TriangleMesh(scene, positions.astype(np.float32), faces.astype(np.int32))
    # The first ray commits Embree's scene, which must not happen in two threads at once.
    scene.run(np.zeros((1, 3), np.float32), np.ones((1, 3), np.float32))
    return scene


def can_trace() -> bool:
    """Whether Embree finds a triangle before a ray: it comes compiled, so an import alone proves little.

    Raises DeviceError without embreex.
    """
    scene = _build_scene(np.array([[0, 0, 1], [1, 0, 1], [0, 1, 1]]), np.array([[0, 1, 2]]))
    found = scene.run(np.array([[0.2, 0.2, 0]], np.float32), np.array([[0, 0, 1]], np.float32), output=1)
    return bool(found["primID"][0] == 0)
