"""Stars and edges of an indexed triangle mesh, and the vector products that algorithms on them need."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from deferred_ir.base.arrays import Array, Bools, Ints


@dataclass
class Stars:
    """Triangles by corner: (u, a, b), each triangle three times, sorted by u; start and count of each u's rows."""

    corners: Ints
    start: Ints
    count: Ints

    def find_rows(self, vertices: Ints) -> tuple[Ints, Ints]:
        """Return the rows of `corners` at `vertices` (n,), star by star, and the index into `vertices` of each row."""
        count = self.count[vertices]
        whose = np.repeat(np.arange(len(vertices)), count)
        ahead = np.repeat(np.cumsum(count) - count, count)
        return self.start[vertices][whose] + np.arange(len(whose)) - ahead, whose


@dataclass
class Edges:
    """Undirected edges. keys: ascending (see `make_edge_keys`); uses: how many triangles have each."""

    keys: Ints
    uses: Ints

    @classmethod
    def from_faces(cls, faces: Ints, total: int) -> Edges:
        """Collect the edges of `faces` (F, 3) on `total` vertices."""
        keys = make_edge_keys(faces, np.roll(faces, -1, axis=1), total)
        return cls(*np.unique(keys, return_counts=True))

    def count_uses(self, keys: Ints) -> Ints:
        """Return how many triangles have these edges; 0 for keys that are no edge."""
        place = np.minimum(np.searchsorted(self.keys, keys), len(self.keys) - 1)
        uses: Ints = np.where(self.keys[place] == keys, self.uses[place], 0)
        return uses


def make_edge_keys(a: Ints, b: Ints, total: int) -> Ints:
    """Return one number for each undirected edge a-b of a mesh of `total` vertices."""
    return np.minimum(a, b) * total + np.maximum(a, b)


def is_degenerate(faces: Ints) -> Bools:
    """Return which of `faces` (F, 3) use a vertex twice, bool (F,)."""
    a, b, c = faces.T
    degenerate: Bools = (a == b) | (b == c) | (c == a)
    return degenerate


def cross_2d(a: Array, b: Array) -> Array:
    """Return the cross product of the first two coordinates of a and b, (n,)."""
    result: Array = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    return result


def cross_3d(a: Array, b: Array) -> Array:
    """Return the cross products of a and b (n, 3); much faster than NumPy's."""
    x, y, z = a.T
    i, j, k = b.T
    return np.stack([y * k - z * j, z * i - x * k, x * j - y * i], axis=1)


def measure_to_segments(p: Array, a: Array, b: Array) -> Array:
    """Return the distances of points p (n, 3) from segments a-b, (n,)."""
    way = b - a
    along = np.clip(((p - a) * way).sum(axis=1) / np.maximum((way**2).sum(axis=1), 1e-300), 0, 1)
    distances: Array = np.linalg.norm(p - a - along[:, None] * way, axis=1)
    return distances
