"""Building parts for generated scenes: everything is made of sheets, grids of quads with a normal at each vertex.

Lengths are in metres, y is up. Flat sheets carry one normal, curved ones the surface's own at each vertex.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from deferred_ir.base.arrays import Array, Ints

Point = Sequence[float] | Array
Profile = Sequence[tuple[float, float]]

CREASE = np.radians(40)
"""A lathe's profile is smooth where it bends by less than this."""

ARC = 15
"""Points on a half circle; odd, so that one is its crown."""


@dataclass
class Mesh:
    """Collects the sheets of one material."""

    positions: list[Array] = field(default_factory=list)
    normals: list[Array] = field(default_factory=list)
    faces: list[Ints] = field(default_factory=list)
    count: int = 0

    def sheet(self, points: Array, normals: Array | Point) -> None:
        """A grid of points (M, N, 3) and its normals, (M, N, 3) or one for all; the winding follows the normals."""
        rows, columns = points.shape[:2]
        flat = points.reshape(-1, 3)
        directions = np.broadcast_to(np.asarray(normals, np.float64), points.shape).reshape(-1, 3)
        directions = directions / np.linalg.norm(directions, axis=1, keepdims=True)
        index = np.arange(rows * columns).reshape(rows, columns)
        a, b, c, d = index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]
        faces = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)])
        cross = np.cross(flat[faces[:, 1]] - flat[faces[:, 0]], flat[faces[:, 2]] - flat[faces[:, 0]])
        # Where a grid narrows to a point one half of a quad is empty.
        full = np.linalg.norm(cross, axis=1) > 1e-9
        faces, cross = faces[full], cross[full]
        away = (cross * directions[faces].sum(axis=1)).sum(axis=1) < 0
        faces[away] = faces[away][:, ::-1]
        self.positions.append(flat)
        self.normals.append(directions)
        self.faces.append(faces + self.count)
        self.count += len(flat)

    def arrays(self) -> tuple[Array, Array, Ints]:
        """All positions and normals, float32 (V, 3), and faces, int32 (F, 3)."""
        return (
            np.concatenate(self.positions).astype(np.float32),
            np.concatenate(self.normals).astype(np.float32),
            np.concatenate(self.faces).astype(np.int32),
        )


@dataclass(frozen=True)
class Frame:
    """Local axes of a wall: s along it, y up, d out of it towards the courtyard; rows of `axes` are s, y, d."""

    origin: Array
    axes: Array

    @classmethod
    def on(cls, origin: Point, towards: Point) -> Frame:
        """The frame at `origin` whose d axis is the horizontal unit vector `towards`."""
        d = np.asarray(towards, np.float64)
        up = np.array([0.0, 1.0, 0.0])
        return cls(np.asarray(origin, np.float64), np.stack([np.cross(up, d), up, d]))

    def points(self, s: Array | float, y: Array | float, d: Array | float) -> Array:
        """World positions of local coordinates, broadcast against each other, (..., 3)."""
        return self.origin + self.vectors(s, y, d)

    def vectors(self, s: Array | float, y: Array | float, d: Array | float) -> Array:
        """World directions of local ones, broadcast against each other, (..., 3)."""
        local = np.stack(np.broadcast_arrays(*(np.asarray(value, np.float64) for value in (s, y, d))), axis=-1)
        world: Array = local @ self.axes
        return world


def rectangle(mesh: Mesh, y: float, x: tuple[float, float], z: tuple[float, float], up: bool = True) -> None:
    """A level rectangle at height `y`."""
    grid = np.array([[(cx, y, cz) for cz in z] for cx in x])
    mesh.sheet(grid, (0, 1 if up else -1, 0))


def box(mesh: Mesh, low: Point, high: Point, without: str = "") -> None:
    """An axis-aligned box; `without` names sides to leave out, such as "-y +x"."""
    corners = np.array([low, high], dtype=np.float64)
    for axis, name in enumerate("xyz"):
        others = [other for other in range(3) if other != axis]
        for end, sign in enumerate("-+"):
            if sign + name in without.split():
                continue
            grid = np.empty((2, 2, 3))
            grid[..., axis] = corners[end, axis]
            grid[..., others[0]] = corners[:, None, others[0]]
            grid[..., others[1]] = corners[None, :, others[1]]
            normal = np.zeros(3)
            normal[axis] = 1 if end else -1
            mesh.sheet(grid, normal)


def framed_box(mesh: Mesh, frame: Frame, low: Point, high: Point, without: str = "") -> None:
    """A box between two corners (s, y, d) of an axis-aligned frame; `without` names world axes as for `box`."""
    corners = frame.points(*np.array([low, high], dtype=np.float64).T)
    box(mesh, corners.min(axis=0), corners.max(axis=0), without)


def lathe(mesh: Mesh, base: Point, profile: Profile, around: int) -> None:
    """A profile of (radius, height) points, from the bottom up, turned about the vertical axis through `base`."""
    points = np.asarray(profile, dtype=np.float64)
    steps = np.diff(points, axis=0)
    angles = np.arctan2(steps[:, 1], steps[:, 0])
    bends = np.abs((np.diff(angles) + np.pi) % (2 * np.pi) - np.pi)
    ends = [0, *(np.flatnonzero(bends > CREASE) + 1), len(steps)]
    phi = 2 * np.pi * np.arange(around + 1) / around
    phi[-1] = 0.0
    ring = np.stack([np.cos(phi), np.zeros_like(phi), np.sin(phi)], axis=-1)
    up = np.array([0.0, 1.0, 0.0])
    for first, last in pairwise(ends):
        part = points[first : last + 1]
        # A vertex's normal is that of the two segments it joins, weighted by their lengths.
        slopes = np.stack([steps[first:last, 1], -steps[first:last, 0]], axis=-1)
        out = np.concatenate([slopes[:1], slopes[:-1] + slopes[1:], slopes[-1:]])
        grid = np.asarray(base) + part[:, None, :1] * ring + part[:, None, 1:] * up
        mesh.sheet(grid, out[:, None, :1] * ring + out[:, None, 1:] * up)


def sweep(mesh: Mesh, half: tuple[float, float], profile: Profile) -> None:
    """A moulding of flat bands inside a rectangle of half widths `half` (x, z): profile points are (projection, y)."""
    for (out_a, y_a), (out_b, y_b) in pairwise(profile):
        # The profile runs with the courtyard to its left, so that this normal is the outer one.
        out, rise = y_b - y_a, out_a - out_b
        for axis in (0, 1):
            for sign in (-1.0, 1.0):
                grid = np.empty((2, 2, 3))
                for row, (projection, y) in enumerate(((out_a, y_a), (out_b, y_b))):
                    for column, side in enumerate((-1.0, 1.0)):
                        ends = [side * (length - projection) for length in half]
                        ends[axis] = sign * (half[axis] - projection)
                        grid[row, column] = ends[0], y, ends[1]
                normal = np.array([0.0, rise, 0.0])
                normal[2 * axis] = -sign * out
                mesh.sheet(grid, normal)


def arch(mesh: Mesh, frame: Frame, radius: float, ends: tuple[float, float], top: float, *, half: float) -> None:
    """A bay of wall with a round arch that springs at s = +-radius, y = 0, with a raised moulding around it.

    The wall runs from s = ends[0] to ends[1], up to y = top, from d = -half to half; its moulding projects beyond.
    """
    theta = np.linspace(0, np.pi, ARC)
    cos, sin = np.cos(theta), np.sin(theta)
    raised, wide = half + 0.05, radius + 0.14
    s, y = radius * cos, radius * sin
    for d in (-half, half):
        normal = frame.vectors(0, 0, np.sign(d))
        mesh.sheet(frame.points(s, np.stack([y, np.full_like(y, top)]), d), normal)
        for edge, end in ((-radius, ends[0]), (radius, ends[1])):
            mesh.sheet(frame.points(np.array([[edge], [end]]), np.array([0.0, top]), d), normal)
    ring = np.array([[radius], [wide]])
    inwards, depths = frame.vectors(-cos, -sin, 0), np.array([[-half], [half], [raised]])
    mesh.sheet(frame.points(s, y, depths), np.broadcast_to(inwards, (3, ARC, 3)))
    mesh.sheet(frame.points(ring * cos, ring * sin, raised), frame.vectors(0, 0, 1))
    mesh.sheet(frame.points(wide * cos, wide * sin, depths[1:]), np.broadcast_to(-inwards, (2, ARC, 3)))


def groin_vault(mesh: Mesh, x: tuple[float, float], z: tuple[float, float], y: float, rise: float) -> None:
    """A cross vault over a rectangle: four webs of two crossing elliptical barrels, springing at height `y`."""
    center = np.array([sum(x) / 2, y, sum(z) / 2])
    half = np.array([(x[1] - x[0]) / 2, rise, (z[1] - z[0]) / 2])
    phi = np.linspace(-np.pi / 2, np.pi / 2, ARC)
    across, height = np.sin(phi), np.cos(phi)
    for axis in (0, 2):
        for sign in (-1.0, 1.0):
            unit = np.zeros((2, len(phi), 3))
            unit[..., axis] = across
            unit[..., 1] = height
            unit[..., 2 - axis] = sign * np.stack([np.abs(across), np.ones_like(across)])
            normals = -unit / half
            normals[..., 2 - axis] = 0
            mesh.sheet(center + unit * half, normals)


def band(mesh: Mesh, frame: Frame, span: float, rise: float, *, half: float, depth: float) -> None:
    """A transverse arch under a vault: half span and rise of the vault, `depth` below it; 2 * half wide along d."""
    theta = np.linspace(0, np.pi, ARC)
    cos, sin = np.cos(theta), np.sin(theta)
    low, high = (span - depth, rise - depth), (span + 0.05, rise + 0.05)
    widths = np.array([[-half], [half]])
    soffit = np.broadcast_to(frame.vectors(-cos / low[0], -sin / low[1], 0), (2, ARC, 3))
    mesh.sheet(frame.points(low[0] * cos, low[1] * sin, widths), soffit)
    for d in (-half, half):
        s, y = (np.outer((low[i], high[i]), (cos, sin)[i]) for i in (0, 1))
        mesh.sheet(frame.points(s, y, d), frame.vectors(0, 0, np.sign(d)))


def cloth(mesh: Mesh, frame: Frame, width: float, drop: float, folds: float) -> None:
    """A hanging cloth: from the frame's origin down by `drop`, in folds along d that open towards its lower edge."""
    u, v = np.meshgrid(np.linspace(-0.5, 0.5, 33), np.linspace(0, 1, 9))
    deep = 0.02 + 0.06 * v
    wave = 2 * np.pi * folds * u + 0.9 * np.sin(2.2 * v)
    d = deep * np.sin(wave)
    slope_u = deep * 2 * np.pi * folds * np.cos(wave) / width
    slope_v = (0.06 * np.sin(wave) + deep * np.cos(wave) * 0.9 * 2.2 * np.cos(2.2 * v)) / drop
    mesh.sheet(frame.points(u * width, -v * drop, d), frame.vectors(-slope_u, slope_v, 1.0))
