"""Voronoi cells of sites in the unit disc: their areas, the largest empty circle, and the most crowded site.

Laine et al. 2007 ("Incremental Instant Radiosity", EGSR, section 4) keep VPLs spread evenly by these three.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from deferred_ir.base.arrays import Array, Ints

GHOSTS = np.array([[4.1, 4.0], [-4.0, 4.2], [-4.3, -4.0], [4.0, -4.4]])
"""Extra sites so far outside that every point of the disc is nearer to a site within it.

They bound every cell, and make any set of sites large and irregular enough for a triangulation.
"""
JITTER = 1e-7
"""Sites are displaced by about this much, so that no two coincide and no four lie on a circle."""


class VoronoiCells:
    """The Voronoi diagram of `sites` (n, 2) in the unit disc, n >= 0, to which sites can be added."""

    def __init__(self, sites: Array) -> None:
        from scipy.spatial import Delaunay

        self.sites = np.asarray(sites, float).reshape(-1, 2)
        self._triangles: Any = Delaunay(np.concatenate([GHOSTS, self._jitter_sites(0)]), incremental=True)

    def add(self, site: Array) -> None:
        """Add a site, (2,), as the last one."""
        self.sites = np.concatenate([self.sites, site[None]])
        self._triangles.add_points(self._jitter_sites(len(self.sites) - 1))

    def _jitter_sites(self, first: int) -> Array:
        moved: Array = (
            self.sites[first:] + JITTER * _make_jitter(1 << len(self.sites).bit_length())[first : len(self.sites)]
        )
        return moved

    def _find_edges(self) -> tuple[Ints, Array, Array]:
        """Return the edges of the cells.

        Of each edge the sites on both sides, int (m, 2), and the ends, (m, 2, 2); of all cells the corners, (k, 2).
        Ghosts have numbers below 0. Unbounded edges, which lie between ghosts, are left out.
        """
        corners, neighbours = self._triangles.simplices, self._triangles.neighbors
        centres = _find_circumcentres(self._triangles.points[corners])
        triangle, opposite = np.nonzero(neighbours > np.arange(len(corners))[:, None])
        sides = np.stack([corners[triangle, opposite - 2], corners[triangle, opposite - 1]], axis=1) - len(GHOSTS)
        return sides, np.stack([centres[triangle], centres[neighbours[triangle, opposite]]], axis=1), centres

    def areas(self) -> Array:
        """Return the fraction of the disc's area that each site's cell has, (n,); they add up to 1."""
        sides, ends, _ = self._find_edges()
        area = _measure_sectors(ends[:, 0], ends[:, 1])
        points = self._triangles.points[sides + len(GHOSTS)]
        # Seen from a site its edges run counter-clockwise.
        turn = np.sign(_cross(ends[:, 0] - points[:, 0], ends[:, 1] - points[:, 0]))
        shares = np.zeros(len(self.sites))
        for side, sign in ((0, turn), (1, -turn)):
            real = sides[:, side] >= 0
            shares += np.bincount(sides[real, side], (sign * area)[real], minlength=len(shares))
        return np.maximum(shares, 0) / np.pi

    def find_emptiest_circle(self, radius: float = 1.0) -> tuple[Array, float]:
        """Return centre (2,) and radius of the largest circle without a site whose centre lies in the disc of `radius`.

        It lies at a corner of the cells, or where an edge of a cell leaves the disc, or opposite a site.
        """
        if not len(self.sites):
            return np.zeros(2), np.inf
        from scipy.spatial import cKDTree

        sides, ends, corners = self._find_edges()
        leaving = (sides >= 0).all(axis=1) & ((ends**2).sum(axis=2) > radius**2).any(axis=1)
        length = np.sqrt((self.sites**2).sum(axis=1, keepdims=True))
        opposite = -radius * self.sites / np.where(length > 0, length, 1)
        opposite[length[:, 0] == 0] = radius, 0
        rim = np.concatenate([_cut_with_circle(ends[leaving, 0], ends[leaving, 1], radius), opposite])
        inside = np.flatnonzero((corners**2).sum(axis=1) <= radius**2)
        sites = self._triangles.points[self._triangles.simplices[inside, 0]]
        tried = np.concatenate([corners[inside], rim])
        distance = np.append(np.linalg.norm(corners[inside] - sites, axis=1), cKDTree(self.sites).query(rim)[0])
        best = int(np.argmax(distance))
        return tried[best], float(distance[best])


def find_most_crowded(sites: Array) -> tuple[int, float]:
    """Return the most crowded of `sites` (n, 2), n >= 2, and the distance to its nearest neighbour.

    It is one of the closest two sites, which the shortest edge of the Delaunay triangulation joins: the one whose next
    neighbour is closer.
    """
    from scipy.spatial import cKDTree

    # The 3 nearest: the site itself (or one that coincides with it), then others; infinity beyond n.
    distance = cKDTree(sites).query(sites, k=3)[0]
    pair = np.flatnonzero(distance[:, 1] == distance[:, 1].min())
    crowded = int(pair[np.argmin(distance[pair, 2])])
    return crowded, float(distance[crowded, 1])


@lru_cache(maxsize=8)
def _make_jitter(count: int) -> Array:
    return np.random.default_rng(0).standard_normal((count, 2))


def _cross(a: Array, b: Array) -> Array:
    cross: Array = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    return cross


def _find_circumcentres(corners: Array) -> Array:
    """Return the centres (n, 2) of the circles through the corners of triangles (n, 3, 2)."""
    a = corners[:, 0]
    b, c = corners[:, 1] - a, corners[:, 2] - a
    bb, cc = (b**2).sum(axis=1), (c**2).sum(axis=1)
    twice = 2 * _cross(b, c)
    centres: Array = a + np.stack([c[:, 1] * bb - b[:, 1] * cc, b[:, 0] * cc - c[:, 0] * bb], axis=1) / twice[:, None]
    return centres


def _find_crossings(a: Array, b: Array, radius: float) -> Array:
    """Return where lines from `a` (0) to `b` (1), both (n, 2), enter and leave the circle, (n, 2); NaN for a miss."""
    way = b - a
    square = np.maximum((way**2).sum(axis=1), 1e-300)
    middle = -(a * way).sum(axis=1) / square
    reach = middle**2 - ((a**2).sum(axis=1) - radius**2) / square
    half = np.sqrt(np.where(reach > 0, reach, np.nan))
    return np.stack([middle - half, middle + half], axis=1)


def _cut_with_circle(a: Array, b: Array, radius: float) -> Array:
    """Return the points (m, 2) where segments from `a` to `b` (n, 2) cross the circle."""
    at = _find_crossings(a, b, radius)
    segment, which = np.nonzero((at >= 0) & (at <= 1))
    return a[segment] + at[segment, which, None] * (b - a)[segment]


def _measure_sectors(a: Array, b: Array) -> Array:
    """Return the signed area, (n,), that the unit disc shares with triangles of its centre, `a` and `b` (n, 2)."""
    at = _find_crossings(a, b, 1.0)
    meets = (at[:, 0] < 1) & (at[:, 1] > 0)
    at = np.clip(np.where(meets[:, None], at, 0), 0, 1)
    p, q = (a + at[:, i, None] * (b - a) for i in (0, 1))
    chord = np.where(meets, _cross(p, q), 0)
    return (_measure_angles(a, p) + chord + _measure_angles(q, b)) / 2


def _measure_angles(a: Array, b: Array) -> Array:
    angle: Array = np.arctan2(_cross(a, b), (a * b).sum(axis=-1))
    return angle
