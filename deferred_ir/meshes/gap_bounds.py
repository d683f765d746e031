"""Bounds of the distance between a star of triangles and what is left of it after its vertex has moved."""

from __future__ import annotations

import numpy as np

from deferred_ir.base.arrays import Array, Bools, Ints
from deferred_ir.meshes.topology import cross_2d
from deferred_ir.sampling.warps import build_basis


class TangentSpaces:
    """Coordinates about vertices u (n,) whose third axes are the normals (n, 3) of their stars."""

    def __init__(self, points: Array, u: Ints, normal: Array) -> None:
        x, y = build_basis(normal)
        self._points, self._u, self._basis = points, u, np.stack([x, y, normal], axis=1)

    def transform(self, w: Ints, i: Ints) -> Array:
        """Return vertices w in the coordinates of stars i, (m, 3)."""
        result: Array = np.einsum("nij,nj->ni", self._basis[i], self._points[w] - self._points[self._u[i]])
        return result


def raise_at_vertices(
    gap: Array, tangent: TangentSpaces, border: Bools, v: Ints, triangles: tuple[Ints, Ints, Ints]
) -> None:
    """Raise `gap` to the heights of u over or under the new triangles (star, a, b) with v in place of u."""
    i, a, b = triangles
    pv, pa, pb = tangent.transform(v[i], i), tangent.transform(a, i), tangent.transform(b, i)
    area = cross_2d(pa - pv, pb - pv)
    gap[i[area <= 0]] = np.inf
    area[area <= 0] = np.inf
    ca, cb = cross_2d(pb, pv) / area, cross_2d(pv, pa) / area
    inside = (ca >= -1e-9) & (cb >= -1e-9) & (ca + cb <= 1 + 1e-9)
    height = np.abs(pv[:, 2] + ca * (pa - pv)[:, 2] + cb * (pb - pv)[:, 2])
    np.maximum.at(gap, i[inside], height[inside])
    covered = np.bincount(i[inside], minlength=len(gap)) > 0
    gap[~covered & ~border] = np.inf


def raise_at_crossings(gap: Array, tangent: TangentSpaces, v: Ints, star: Ints, w: Ints) -> None:
    """Raise `gap` to the distances of old spokes u-w from the new spokes v-r that they cross."""
    first = np.searchsorted(star, np.arange(len(gap)))
    count = np.bincount(star, minlength=len(gap))
    each = count[star]
    old = np.repeat(np.arange(len(star)), each)
    new = first[star][old] + np.arange(len(old)) - np.repeat(np.cumsum(each) - each, each)
    differ = (old != new) & (w[old] != v[star[old]]) & (w[new] != v[star[old]])
    old, new = old[differ], new[differ]
    place, i = tangent.transform(w, star), star[old]
    pw, pv = place[old], tangent.transform(v[i], i)
    way = place[new] - pv
    turn = cross_2d(pw, way)
    with np.errstate(divide="ignore", invalid="ignore"):
        s, t = cross_2d(pv, way) / turn, cross_2d(pv, pw) / turn
        meet = (s >= 0) & (s <= 1) & (t >= 0) & (t <= 1)
        apart = np.abs(s * pw[:, 2] - pv[:, 2] - t * way[:, 2])
    np.maximum.at(gap, i[meet], apart[meet])
