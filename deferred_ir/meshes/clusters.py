"""Clusters of triangles with bounding boxes, and which of them each light's map may show. No OpenGL."""

from __future__ import annotations

import itertools

import numpy as np

from deferred_ir.base.arrays import Array, Bools, Ints

CLUSTER = 64
"""Most triangles in a cluster."""
OCTAVES = 10
"""The longest edges of a cluster's triangles lie in one octave, down to 2^-OCTAVES of the longest of all."""
ROUNDING = 2.0**-18
"""Slack of the test against a plane, relative to the terms it adds: 64 roundings, this test's and the shader's."""

EVERY = slice(None)


class Clusters:
    """Faces (F, 3) of `positions` (V, 3), clustered by place, by size and, if there are any, by `groups` (F,).

    order: int (F,), the faces of cluster 0, then of cluster 1, ... starts: int (C + 1,), where in `order` each begins.
    reach: the largest absolute coordinate. The clusters of a group are consecutive, groups in ascending order.
    """

    def __init__(self, positions: Array, faces: Ints, most: int = CLUSTER, groups: Ints | None = None) -> None:
        corners = positions.astype(np.float32)[faces]
        low, high = corners.min(axis=1), corners.max(axis=1)
        edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
        # Group triangles of similar size: one large triangle would make its whole cluster count as bent.
        classes = _classify(edges)
        if groups is not None:
            classes += groups * (OCTAVES + 1)
        self.order, self.starts = split_points(low / 2 + high / 2, classes, most)
        first = self.starts[:-1]
        self._longest = np.maximum.reduceat(edges[self.order], first)
        self._boxes = np.ones((7, len(first)), np.float32)
        self._set_boxes(slice(0, len(first)), low[self.order], high[self.order])

    def _set_boxes(self, chosen: slice, low: Array, high: Array) -> None:
        """Set the boxes of the clusters `chosen`; low, high: corners (n, 3) of their faces' boxes, in order."""
        at = self.starts[chosen] - self.starts[chosen.start]
        low, high = np.minimum.reduceat(low, at), np.maximum.reduceat(high, at)
        centre = low / 2 + high / 2
        self._boxes[:3, chosen], self._boxes[3:6, chosen] = centre.T, np.maximum(high - centre, centre - low).T
        self.reach = float((np.abs(self._boxes[:3]) + self._boxes[3:6]).max())

    def move(self, chosen: slice, corners: Array) -> None:
        """Update the boxes of the clusters `chosen` after a rigid motion of their triangles.

        corners: float32 (n, 3, 3), of the triangles in order.
        """
        self._set_boxes(chosen, corners.min(axis=1), corners.max(axis=1))

    def __len__(self) -> int:
        return len(self.starts) - 1

    @property
    def sizes(self) -> Ints:
        """Number of triangles of each cluster, int (C,)."""
        return np.diff(self.starts)

    def find_visible(self, lights: np.ndarray, *, hemisphere: bool = False) -> Bools:
        """Find the clusters that may show in the maps of `lights`, LIGHT records (n,): bool (n, C).

        A map shows its pyramid; with `hemisphere`, everything in front of the light. A culled cluster lies outside by
        more than rounding errors, so its triangles would have covered no texel.
        """
        if len(self) == 1:
            return np.ones((len(lights), 1), bool)
        return self.find_within(lights, hemisphere=hemisphere)

    def find_within(
        self, lights: np.ndarray, *, hemisphere: bool = False, margin: float = 0.0, only: Ints | slice = EVERY
    ) -> Bools:
        """Find the clusters, or those of `only`, that may be in the lights' pyramids or `margin` outside: (n, C)."""
        x, y, z = (lights[axis] for axis in ("x_axis", "y_axis", "z_axis"))
        position = lights["position"]
        # An upper bound of the terms that the dot products here and in the shader add up.
        terms = (np.abs(x) + np.abs(y) + np.abs(z)).sum(axis=1) * (self.reach + np.abs(position).max(axis=1))
        normals = np.stack([z] if hemisphere else [z, z + x, z - x, z + y, z - y])
        # The corner of the box that is farthest along the normal decides.
        planes = np.empty((*normals.shape[:2], 7), np.float32)
        planes[..., :3] = normals
        np.abs(normals, out=planes[..., 3:6])
        planes[..., 6] = terms * np.float32(ROUNDING) - np.einsum("pni,ni->pn", normals, position)
        if margin > 0:
            planes[..., 6] += np.float32(margin) * np.sqrt(np.einsum("pni,pni->pn", normals, normals))
        boxes = self._boxes[:, only]
        outside = np.zeros((len(lights), boxes.shape[1]), bool)
        for plane in planes:
            outside |= plane @ boxes < 0
        return ~outside

    def find_drawn(self, lights: np.ndarray) -> Bools:
        """Find the clusters that make up the scene for `lights`, LIGHT records (n,), before culling: bool (n, C)."""
        return np.ones((len(lights), len(self)), bool)

    def find_bent(self, lights: np.ndarray, reach: Array) -> Bools:
        """Find the clusters with an edge that may be nearer to a light than `reach` (n,) times its length, (n, C)."""
        centre, half = self._boxes[:3], self._boxes[3:6]
        away = np.maximum(np.abs(lights["position"][:, :, None] - centre) - half, 0)
        bent: Bools = (away**2).sum(axis=1) < (reach[:, None] * self._longest) ** 2
        return bent


def _classify(edges: Array) -> Ints:
    """Return the octave of each longest edge (F,) below the longest of all, from 0 down to -OCTAVES."""
    longest = edges.max()
    shares = edges / longest if longest > 0 else edges
    classes: Ints = np.ceil(np.log2(np.maximum(shares, 2.0**-OCTAVES))).astype(np.intp)
    return classes


def split_points(points: Array, classes: Ints, most: int) -> tuple[Ints, Ints]:
    """Halve the `points` (n, 3) of each class across their longest extent until no set has more than `most`.

    Returns the order of the points, (n,), and where in it each set starts, with the end.
    """
    order = np.argsort(classes, kind="stable")
    bounds = [0, *(np.flatnonzero(np.diff(classes[order])) + 1).tolist(), len(points)]
    starts, ahead = [len(points)], list(itertools.pairwise(bounds))
    while ahead:
        start, end = ahead.pop()
        if end - start <= most:
            starts.append(start)
            continue
        part = points[order[start:end]]
        # Multiples of `most` go to the left, so that all sets but the last are full.
        middle = -(-(end - start) // (2 * most)) * most
        axis = np.ptp(part, axis=0).argmax()
        order[start:end] = order[start:end][np.argpartition(part[:, axis], middle - 1)]
        ahead += [(start, start + middle), (start + middle, end)]
    return order, np.sort(starts)
