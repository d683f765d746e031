"""Simplifies a mesh with a bound on how far its surface moves. No OpenGL.

Each step collapses a vertex along an edge onto a neighbour. No point of its triangles moves farther than the edge is
long. There is a smaller bound if the triangles before and after, seen along the normal of the star, cover the same
polygon once: both are height fields over it, and their difference, which is linear over each cell of their overlay, is
largest at a vertex of the overlay, which is the moved vertex or a crossing of an old and a new edge. The bounds add up
for each triangle and hold in both directions (after Bajaj and Schikore, "Error-bounded reduction of triangle meshes",
1996).

The code is our own because libraries with wheels stop at a number of triangles (fast-simplification, Open3D) or at a
quadric error, which is an average: asked for 0.02 units, meshoptimizer moves a cathedral of 80,000 triangles by up to
0.14.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from deferred_ir.base.arrays import Array, Bools, Ints
from deferred_ir.meshes.gap_bounds import TangentSpaces, raise_at_crossings, raise_at_vertices
from deferred_ir.meshes.topology import (
    Edges,
    Stars,
    cross_3d,
    is_degenerate,
    make_edge_keys,
    measure_to_segments,
)

STEEPEST = 0.1
"""Least cosine between the normal of a star and those of its triangles: sharper tips and folds are not collapsed."""
FEW = 0.002
"""The last round is the one that collapses fewer vertices than this fraction of the triangles."""


def weld_vertices(positions: Array, faces: Ints) -> Ints:
    """Return `faces` (F, 3) with each vertex replaced by the first one at the same place in float32."""
    _, first, place = np.unique(positions.astype(np.float32), axis=0, return_index=True, return_inverse=True)
    result: Ints = first[place.reshape(-1)][faces]
    return result


def simplify(positions: Array, faces: Ints, deviations: Sequence[float], locked: Bools) -> list[tuple[Ints, Ints]]:
    """Simplify a mesh to each of the ascending `deviations`, in world units, on its own vertices `positions` (V, 3).

    Returns for each deviation the triangles left (F', 3) and which of `faces` (F, 3) each was. No point of one surface
    is farther than the deviation from the other. Vertices in `locked` (V,) stay. `faces` should be welded, or seams
    stay as borders. Closed surfaces stay closed.
    """
    mesh = _Mesh(positions.astype(np.float64), faces, locked)
    result = list[tuple[Ints, Ints]]()
    for deviation in deviations:
        mesh.waiting = ~locked
        mesh.refused = np.empty(0, np.int64)
        while mesh.collapse_round(float(deviation)) > FEW * len(mesh.faces):
            pass
        result.append((mesh.faces.copy(), mesh.origin.copy()))
    return result


@dataclass
class _Moves:
    """Candidates: vertices u move along edges onto v. regular: the star of u has a bound better than the length."""

    u: Ints
    v: Ints
    length: Array
    regular: Bools

    def select(self, chosen: Ints | Bools) -> _Moves:
        """Return some of the moves, in the order of `chosen` if that holds indices."""
        return _Moves(self.u[chosen], self.v[chosen], self.length[chosen], self.regular[chosen])


@dataclass
class _Survey:
    """The mesh at the start of a round.

    face: the triangle of each row of the stars. normal, border, regular: of stars, by vertex (see `_classify_stars`).
    spent: the largest deviation so far around each vertex.
    """

    edges: Edges
    stars: Stars
    face: Ints
    normal: Array
    border: Bools
    regular: Bools
    spent: Array


class _Mesh:
    """A mesh on its way from level to level."""

    def __init__(self, positions: Array, faces: Ints, locked: Bools) -> None:
        self.points, self.locked = positions, locked
        proper = ~is_degenerate(faces)
        self.faces, self.origin = faces[proper].astype(np.int64), np.flatnonzero(proper)
        self.moved = np.zeros(len(self.faces))  # bound of each triangle's deviation so far
        self.refused = np.empty(0, np.int64)  # directed edges along which no vertex may move
        self.waiting = ~locked  # vertices that may have a move

    def collapse_round(self, deviation: float) -> int:
        """Collapse an independent set of vertices, each within its error bound. Returns how many."""
        if not len(self.faces):
            return 0
        survey = self._survey()
        moves = self._pick_independent(self._propose(survey, deviation), survey.edges)
        u, v, regular = moves.u, moves.v, moves.regular
        gap = moves.length.copy()
        gap[regular] = np.minimum(gap[regular], self._bound_gaps(survey, u[regular], v[regular]))
        gap[self._find_pinches(survey, u, v)] = np.inf
        good = gap + survey.spent[u] <= deviation
        self.refused = np.union1d(self.refused, u[~good] * len(self.points) + v[~good])
        self._collapse(survey, u[good], v[good], gap[good])
        return int(good.sum())

    def _survey(self) -> _Survey:
        edges = Edges.from_faces(self.faces, len(self.points))
        stars, face = self._make_stars()
        normal, border, regular = self._classify_stars(stars, edges)
        spent = np.zeros(len(self.points))
        np.maximum.at(spent, stars.corners[:, 0], self.moved[face])
        return _Survey(edges, stars, face, normal, border, regular, spent)

    def _propose(self, survey: _Survey, deviation: float) -> _Moves:
        """Find the best move of each waiting vertex that may stay within the deviation, best moves first."""
        total, points, spent = len(self.points), self.points, survey.spent
        low, high = np.divmod(survey.edges.keys, total)
        u, v = np.concatenate([low, high]), np.concatenate([high, low])
        length = np.linalg.norm(points[u] - points[v], axis=1)
        regular = survey.regular[u] & (~survey.border[u] | np.tile(survey.edges.uses == 1, 2))
        may = self.waiting[u] & (spent[u] < deviation) & (regular | (length + spent[u] <= deviation))
        moves = _Moves(u, v, length, regular).select(may)
        moves = moves.select(~np.isin(moves.u * total + moves.v, self.refused))
        cost = moves.length.copy()
        own = moves.regular
        cost[own] = np.minimum(cost[own], self._estimate_costs(survey, moves.u[own], moves.v[own]))
        good = cost + spent[moves.u] <= deviation
        moves, cost = moves.select(good), cost[good]
        # Shorter edges first where nothing else decides: they leave better triangles.
        moves = moves.select(np.lexsort((moves.length, np.round(cost / deviation, 2))))
        return moves.select(np.sort(np.unique(moves.u, return_index=True)[1]))

    def _pick_independent(self, moves: _Moves, edges: Edges) -> _Moves:
        """Pick moves whose vertices are no neighbours: those ranked before all their neighbours.

        Chance decides within a quarter of the ranks: else chains of neighbours would go one by one. The vertices of
        all moves wait for another round.
        """
        total = len(self.points)
        low, high = np.divmod(edges.keys, total)
        rank = np.full(total, total)
        count = len(moves.u)
        quarter = count // 4 + 1
        rank[moves.u] = np.lexsort((np.random.default_rng(0).random(count), np.arange(count) // quarter)).argsort()
        lowest = np.full(total, total)
        np.minimum.at(lowest, low, rank[high])
        np.minimum.at(lowest, high, rank[low])
        self.waiting[:] = False
        self.waiting[moves.u] = True
        return moves.select(rank[moves.u] < lowest[moves.u])

    def _collapse(self, survey: _Survey, u: Ints, v: Ints, gap: Array) -> None:
        """Move vertices u onto v and drop the triangles that become degenerate. gap: bounds of the moves."""
        rows, whose = survey.stars.find_rows(u)
        self.moved[survey.face[rows]] = (survey.spent[u] + gap)[whose]
        self.waiting[survey.stars.corners[rows]] = True
        self.waiting[u] = False
        self.waiting &= ~self.locked
        to = np.arange(len(self.points))
        to[u] = v
        self.faces = to[self.faces]
        left = ~is_degenerate(self.faces)
        self.faces, self.moved, self.origin = self.faces[left], self.moved[left], self.origin[left]

    def _make_stars(self) -> tuple[Stars, Ints]:
        """Make the stars of the vertices that wait. Returns also the triangle of each row."""
        corners = np.concatenate([np.roll(self.faces, -k, axis=1) for k in range(3)])
        face = np.tile(np.arange(len(self.faces)), 3)
        wanted = np.flatnonzero(self.waiting[corners[:, 0]])
        wanted = wanted[np.argsort(corners[wanted, 0], kind="stable")]
        count = np.bincount(corners[wanted, 0], minlength=len(self.points))
        return Stars(corners[wanted], np.cumsum(count) - count, count), face[wanted]

    def _classify_stars(self, stars: Stars, edges: Edges) -> tuple[Array, Bools, Bools]:
        """Return each star's unit normal, whether it has a border, and whether it is regular.

        A regular star is one fan of triangles that, seen along the normal, covers its polygon once.
        """
        total, points = len(self.points), self.points
        u, a, b = stars.corners.T
        across = cross_3d(points[a] - points[u], points[b] - points[u])
        summed: Array = np.stack([np.bincount(u, across[:, k], total) for k in range(3)], axis=1).astype(np.float64)
        normal = summed / np.maximum(np.linalg.norm(summed, axis=1), 1e-300)[:, None]
        n = normal[u]
        facing = (across * n).sum(axis=1) > STEEPEST * np.linalg.norm(across, axis=1)
        pa, pb = ((points[w] - points[u]) - ((points[w] - points[u]) * n).sum(axis=1)[:, None] * n for w in (a, b))
        angle = np.arctan2((cross_3d(pa, pb) * n).sum(axis=1), (pa * pb).sum(axis=1))
        around = np.bincount(u, angle, total)
        ends = np.concatenate(np.divmod(edges.keys, total))
        spokes = np.bincount(ends, minlength=total)
        open_ = np.bincount(ends, np.tile(edges.uses == 1, 2), total)
        crowded = np.bincount(ends, np.tile(edges.uses > 2, 2), total) > 0
        folded = np.bincount(u, ~facing, total) > 0
        inner = (open_ == 0) & (spokes == stars.count) & (np.abs(around - 2 * np.pi) < 1e-3)
        edge = (open_ == 2) & (spokes == stars.count + 1) & (around < 2 * np.pi - 1e-3)
        return normal, open_ > 0, self.waiting & ~crowded & ~folded & (inner | edge)

    def _estimate_costs(self, survey: _Survey, u: Ints, v: Ints) -> Array:
        """Return, for moves of vertices u to v, v's distance from the planes of u's triangles; inf where one folds."""
        cost = np.zeros(len(u))
        if not len(u):
            return cost
        rows, whose = survey.stars.find_rows(u)
        points = self.points
        _, a, b = survey.stars.corners[rows].T
        at, to = points[u][whose], points[v][whose]
        pa, pb = points[a], points[b]
        old = cross_3d(pa - at, pb - at)
        off = np.abs(((to - at) * old).sum(axis=1)) / np.maximum(np.linalg.norm(old, axis=1), 1e-300)
        new = cross_3d(pa - to, pb - to)
        flat = (new * survey.normal[u][whose]).sum(axis=1) <= STEEPEST * np.linalg.norm(new, axis=1)
        off[flat & (a != v[whose]) & (b != v[whose])] = np.inf
        np.maximum.at(cost, whose, off)
        return cost

    def _find_pinches(self, survey: _Survey, u: Ints, v: Ints) -> Bools:
        """Return which moves would change the topology of the surface.

        A move may not join separate parts, by the link condition: the common neighbours of u and v are those opposite
        to their edge. Nor may it remove a triangle and leave none beside it in the star.
        """
        stars, edges = survey.stars, survey.edges
        total = len(self.points)
        rows, star = stars.find_rows(u)
        _, a, b = stars.corners[rows].T
        star, w = np.divmod(np.unique(np.concatenate([star * total + a, star * total + b])), total)
        common = (edges.count_uses(make_edge_keys(w, v[star], total)) > 0) & (w != v[star])
        bare = common & (edges.count_uses(make_edge_keys(w, u[star], total)) == 1)
        pinches: Bools = np.bincount(star, common, len(u)) != edges.count_uses(make_edge_keys(u, v, total))
        return pinches | (np.bincount(star, bare, len(u)) > 0)

    def _bound_gaps(self, survey: _Survey, u: Ints, v: Ints) -> Array:
        """Return bounds of the distance between the surfaces before and after u moves to v; inf where none is known."""
        gap = np.zeros(len(u))
        if not len(u):
            return gap
        total, border = len(self.points), survey.border[u]
        tangent = TangentSpaces(self.points, u, survey.normal[u])
        rows, whose = survey.stars.find_rows(u)
        _, a, b = survey.stars.corners[rows].T
        whole = (a != v[whose]) & (b != v[whose])
        raise_at_vertices(gap, tangent, border, v, (whose[whole], a[whole], b[whole]))
        # The far ends of the spokes of each star, each once.
        star, w = np.divmod(np.unique(np.concatenate([whose * total + a, whose * total + b])), total)
        raise_at_crossings(gap, tangent, v, star, w)
        # A border moves sideways as well: from u-w to v-w.
        at = np.flatnonzero(border[star] & (w != v[star]))
        at = at[survey.edges.count_uses(make_edge_keys(w[at], u[star[at]], total)) == 1]
        i = star[at]
        gap[i] += measure_to_segments(self.points[u[i]], self.points[v[i]], self.points[w[at]])
        return gap
