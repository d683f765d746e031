"""Simplifies a mesh with a bound on how far its surface moves. No OpenGL.

A vertex at a time moves along an edge onto a neighbour and takes its triangles with it, no point of them farther than
the edge is long. Where the triangles before and after, seen along the normal of the star, cover the same polygon once,
less is known: both are height fields over it, and their difference, linear over each cell of the overlay of both, is
largest at a vertex of the overlay: the moved one, or where an old edge crosses a new one. These bounds, added up for
each triangle, hold either way (after Bajaj and Schikore, Error-bounded reduction of triangle meshes, 1996).

Own code, for the libraries with wheels stop at a number of triangles (fast-simplification, Open3D) or at a quadric
error, an average: asked for 0.02 units, meshoptimizer moves a cathedral of 80,000 triangles by up to 0.14.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from deferred_ir.base.arrays import Array, Bools, Ints
from deferred_ir.sampling.warps import build_basis

STEEPEST = 0.1
"""Least cosine between the normal of a star and those of its triangles: sharper tips and folds stay."""
FEW = 0.002
"""A round that moves fewer vertices than this share of the triangles is the last."""


def weld_vertices(positions: Array, faces: Ints) -> Ints:
    """`faces` (F, 3) with each vertex replaced by the first that lies, in float32, at the same place."""
    _, first, place = np.unique(positions.astype(np.float32), axis=0, return_index=True, return_inverse=True)
    result: Ints = first[place.reshape(-1)][faces]
    return result


def simplify(positions: Array, faces: Ints, deviations: Sequence[float], locked: Bools) -> list[tuple[Ints, Ints]]:
    """Meshes on the vertices `positions` (V, 3) that are ever coarser: for each of the ascending `deviations`, in world
    units, the triangles left (F', 3) and which of `faces` (F, 3) each was.

    No point of one surface is farther than the deviation from the other. Vertices in `locked` (V,) stay. `faces`
    should be welded, or seams stay as borders. What is closed stays closed.
    """
    mesh = _Mesh(positions.astype(np.float64), faces, locked)
    result = list[tuple[Ints, Ints]]()
    for deviation in deviations:
        mesh.waiting = ~locked
        mesh.refused = np.empty(0, np.int64)
        while mesh.round(float(deviation)) > FEW * len(mesh.faces):
            pass
        result.append((mesh.faces.copy(), mesh.origin.copy()))
    return result


@dataclass
class _Stars:
    """Triangles by corner: (u, a, b), each triangle three times, sorted by u; start and count of each u's."""

    corners: Ints
    start: Ints
    count: Ints

    def of(self, vertices: Ints) -> tuple[Ints, Ints]:
        """Rows of `corners` at each of `vertices` (n,), one star after the other, and in which row of `vertices`."""
        count = self.count[vertices]
        whose = np.repeat(np.arange(len(vertices)), count)
        ahead = np.repeat(np.cumsum(count) - count, count)
        return self.start[vertices][whose] + np.arange(len(whose)) - ahead, whose


@dataclass
class _Edges:
    """keys: of all edges, ascending (see `_keys`); uses: how many triangles have each."""

    keys: Ints
    uses: Ints

    def of(self, keys: Ints) -> Ints:
        """How many triangles have these edges; 0 where there is no such edge."""
        place = np.minimum(np.searchsorted(self.keys, keys), len(self.keys) - 1)
        found: Ints = np.where(self.keys[place] == keys, self.uses[place], 0)
        return found


class _Mesh:
    def __init__(self, positions: Array, faces: Ints, locked: Bools) -> None:
        self.points, self.locked = positions, locked
        kept = ~_degenerate(faces)
        self.faces, self.origin = faces[kept].astype(np.int64), np.flatnonzero(kept)
        self.moved = np.zeros(len(self.faces))  # bound of each triangle's distance so far
        self.refused = np.empty(0, np.int64)  # directed edges along which no vertex may move
        self.waiting = ~locked  # vertices that may have somewhere to go, as far as is known

    def round(self, deviation: float) -> int:
        """Move vertices none of which are neighbours, each as far as it may; how many."""
        if not len(self.faces):
            return 0
        total, points = len(self.points), self.points
        edges = _Edges(*np.unique(_keys(self.faces, np.roll(self.faces, -1, axis=1), total), return_counts=True))
        low, high = np.divmod(edges.keys, total)
        stars, face = self._stars()
        normal, border, movable = self._shape(stars, edges)
        spent = np.zeros(total)
        np.maximum.at(spent, stars.corners[:, 0], self.moved[face])

        u, v = np.concatenate([low, high]), np.concatenate([high, low])
        length = np.linalg.norm(points[u] - points[v], axis=1)
        regular = movable[u] & (~border[u] | np.tile(edges.uses == 1, 2))
        may = self.waiting[u] & (spent[u] < deviation) & (regular | (length + spent[u] <= deviation))
        u, v, length, regular = u[may], v[may], length[may], regular[may]
        fresh = ~np.isin(u * total + v, self.refused)
        u, v, length, regular = u[fresh], v[fresh], length[fresh], regular[fresh]
        cost = length.copy()
        cost[regular] = np.minimum(length[regular], self._costs(stars, normal, u[regular], v[regular]))
        good = cost + spent[u] <= deviation
        u, v, length, cost, regular = u[good], v[good], length[good], cost[good], regular[good]
        # Shorter edges first where nothing else decides: they leave better triangles.
        order = np.lexsort((length, np.round(cost / deviation, 2)))
        u, v, length, regular = u[order], v[order], length[order], regular[order]
        best = np.sort(np.unique(u, return_index=True)[1])
        u, v, length, regular = u[best], v[best], length[best], regular[best]

        # Those ranked before all their neighbours go. Chance decides within a quarter: else they would go one by one.
        rank = np.full(total, total)
        quarter = len(u) // 4 + 1
        rank[u] = np.lexsort((np.random.default_rng(0).random(len(u)), np.arange(len(u)) // quarter)).argsort()
        lowest = np.full(total, total)
        np.minimum.at(lowest, low, rank[high])
        np.minimum.at(lowest, high, rank[low])
        self.waiting[:] = False
        self.waiting[u] = True
        first = rank[u] < lowest[u]
        u, v, length, regular = u[first], v[first], length[first], regular[first]
        gap = length
        gap[regular] = np.minimum(gap[regular], self._gaps(stars, edges, (normal, border), u[regular], v[regular]))
        gap[self._pinches(stars, edges, u, v)] = np.inf
        good = gap + spent[u] <= deviation
        self.refused = np.union1d(self.refused, u[~good] * total + v[~good])
        u, v, gap = u[good], v[good], gap[good]
        rows, whose = stars.of(u)
        self.moved[face[rows]] = (spent[u] + gap)[whose]
        self.waiting[stars.corners[rows]] = True
        self.waiting[u] = False
        self.waiting &= ~self.locked
        to = np.arange(total)
        to[u] = v
        self.faces = to[self.faces]
        kept = ~_degenerate(self.faces)
        self.faces, self.moved, self.origin = self.faces[kept], self.moved[kept], self.origin[kept]
        return len(u)

    def _stars(self) -> tuple[_Stars, Ints]:
        """Stars of the vertices that wait, and of which triangle each row is."""
        corners = np.concatenate([np.roll(self.faces, -k, axis=1) for k in range(3)])
        face = np.tile(np.arange(len(self.faces)), 3)
        wanted = np.flatnonzero(self.waiting[corners[:, 0]])
        wanted = wanted[np.argsort(corners[wanted, 0], kind="stable")]
        count = np.bincount(corners[wanted, 0], minlength=len(self.points))
        return _Stars(corners[wanted], np.cumsum(count) - count, count), face[wanted]

    def _shape(self, stars: _Stars, edges: _Edges) -> tuple[Array, Bools, Bools]:
        """Each star's unit normal, whether it lies at a border, and whether it is regular: one fan that covers once."""
        total, points = len(self.points), self.points
        u, a, b = stars.corners.T
        across = _normal(points[a] - points[u], points[b] - points[u])
        summed: Array = np.stack([np.bincount(u, across[:, k], total) for k in range(3)], axis=1).astype(np.float64)
        normal = summed / np.maximum(np.linalg.norm(summed, axis=1), 1e-300)[:, None]
        n = normal[u]
        facing = (across * n).sum(axis=1) > STEEPEST * np.linalg.norm(across, axis=1)
        pa, pb = ((points[w] - points[u]) - ((points[w] - points[u]) * n).sum(axis=1)[:, None] * n for w in (a, b))
        angle = np.arctan2((_normal(pa, pb) * n).sum(axis=1), (pa * pb).sum(axis=1))
        around = np.bincount(u, angle, total)
        ends = np.concatenate(np.divmod(edges.keys, total))
        spokes = np.bincount(ends, minlength=total)
        open_ = np.bincount(ends, np.tile(edges.uses == 1, 2), total)
        crowded = np.bincount(ends, np.tile(edges.uses > 2, 2), total) > 0
        turned = np.bincount(u, ~facing, total) > 0
        inner = (open_ == 0) & (spokes == stars.count) & (np.abs(around - 2 * np.pi) < 1e-3)
        edge = (open_ == 2) & (spokes == stars.count + 1) & (around < 2 * np.pi - 1e-3)
        return normal, open_ > 0, self.waiting & ~crowded & ~turned & (inner | edge)

    def _costs(self, stars: _Stars, normal: Array, u: Ints, v: Ints) -> Array:
        """How far v lies off the planes at u, at most; inf where a triangle would fold over."""
        cost = np.zeros(len(u))
        if not len(u):
            return cost
        rows, whose = stars.of(u)
        points = self.points
        _, a, b = stars.corners[rows].T
        at, to = points[u][whose], points[v][whose]
        pa, pb = points[a], points[b]
        old = _normal(pa - at, pb - at)
        off = np.abs(((to - at) * old).sum(axis=1)) / np.maximum(np.linalg.norm(old, axis=1), 1e-300)
        new = _normal(pa - to, pb - to)
        flat = (new * normal[u][whose]).sum(axis=1) <= STEEPEST * np.linalg.norm(new, axis=1)
        off[flat & (a != v[whose]) & (b != v[whose])] = np.inf
        np.maximum.at(cost, whose, off)
        return cost

    def _pinches(self, stars: _Stars, edges: _Edges, u: Ints, v: Ints) -> Bools:
        """Whether moving u to v would join what is apart, or take a triangle away and leave none beside it in the star.

        The first by the link condition: neighbours of both u and v lie opposite to their edge, no others.
        """
        total = len(self.points)
        rows, star = stars.of(u)
        _, a, b = stars.corners[rows].T
        star, w = np.divmod(np.unique(np.concatenate([star * total + a, star * total + b])), total)
        common = (edges.of(_keys(w, v[star], total)) > 0) & (w != v[star])
        bare = common & (edges.of(_keys(w, u[star], total)) == 1)
        pinches: Bools = np.bincount(star, common, len(u)) != edges.of(_keys(u, v, total))
        return pinches | (np.bincount(star, bare, len(u)) > 0)

    def _gaps(self, stars: _Stars, edges: _Edges, shape: tuple[Array, Bools], u: Ints, v: Ints) -> Array:
        """Bound of the distance between the surfaces before and after u moves to v; inf where none is known."""
        normal, border = shape
        total, points = len(self.points), self.points
        gap = np.zeros(len(u))
        if not len(u):
            return gap
        x, y = build_basis(normal[u])
        basis = np.stack([x, y, normal[u]], axis=1)
        rows, whose = stars.of(u)
        _, a, b = stars.corners[rows].T

        def local(w: Ints, i: Ints) -> Array:
            """Vertices w in the frames of stars i, whose normals are the third axes."""
            result: Array = np.einsum("nij,nj->ni", basis[i], points[w] - points[u[i]])
            return result

        # Spokes of each star: the far ends, each once.
        spokes = np.unique(np.concatenate([whose * total + a, whose * total + b]))
        star, w = np.divmod(spokes, total)
        # u over or under the new triangles.
        whole = (a != v[whose]) & (b != v[whose])
        i, a, b = whose[whole], a[whole], b[whole]
        pv, pa, pb = local(v[i], i), local(a, i), local(b, i)
        area = _cross(pa - pv, pb - pv)
        gap[i[area <= 0]] = np.inf
        area[area <= 0] = np.inf
        ca, cb = _cross(pb, pv) / area, _cross(pv, pa) / area
        inside = (ca >= -1e-9) & (cb >= -1e-9) & (ca + cb <= 1 + 1e-9)
        height = np.abs(pv[:, 2] + ca * (pa - pv)[:, 2] + cb * (pb - pv)[:, 2])
        np.maximum.at(gap, i[inside], height[inside])
        covered = np.bincount(i[inside], minlength=len(u)) > 0
        gap[~covered & ~border[u]] = np.inf
        # Old spokes u-w across new spokes v-r.
        first = np.searchsorted(star, np.arange(len(u)))
        count = np.bincount(star, minlength=len(u))
        each = count[star]
        old = np.repeat(np.arange(len(star)), each)
        new = first[star][old] + np.arange(len(old)) - np.repeat(np.cumsum(each) - each, each)
        differ = (old != new) & (w[old] != v[star[old]]) & (w[new] != v[star[old]])
        old, new = old[differ], new[differ]
        place, i = local(w, star), star[old]
        pw, pv = place[old], local(v[i], i)
        way = place[new] - pv
        turn = _cross(pw, way)
        with np.errstate(divide="ignore", invalid="ignore"):
            s, t = _cross(pv, way) / turn, _cross(pv, pw) / turn
            meet = (s >= 0) & (s <= 1) & (t >= 0) & (t <= 1)
            apart = np.abs(s * pw[:, 2] - pv[:, 2] - t * way[:, 2])
        np.maximum.at(gap, i[meet], apart[meet])
        # A border moves sideways as well: from u-c to v-c.
        at = np.flatnonzero(border[u[star]] & (w != v[star]))
        key = _keys(w[at], u[star[at]], total)
        at = at[edges.of(key) == 1]
        i = star[at]
        gap[i] += _to_segment(points[u[i]], points[v[i]], points[w[at]])
        return gap


def _degenerate(faces: Ints) -> Bools:
    a, b, c = faces.T
    found: Bools = (a == b) | (b == c) | (c == a)
    return found


def _keys(a: Ints, b: Ints, total: int) -> Ints:
    """One number for each undirected edge."""
    return np.minimum(a, b) * total + np.maximum(a, b)


def _cross(a: Array, b: Array) -> Array:
    """Of the first two coordinates."""
    result: Array = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    return result


def _normal(a: Array, b: Array) -> Array:
    """Cross products of a and b (n, 3); much faster than NumPy's."""
    x, y, z = a.T
    i, j, k = b.T
    return np.stack([y * k - z * j, z * i - x * k, x * j - y * i], axis=1)


def _to_segment(p: Array, a: Array, b: Array) -> Array:
    """Distances of points p (n, 3) from segments a-b."""
    way = b - a
    along = np.clip(((p - a) * way).sum(axis=1) / np.maximum((way**2).sum(axis=1), 1e-300), 0, 1)
    distances: Array = np.linalg.norm(p - a - along[:, None] * way, axis=1)
    return distances
