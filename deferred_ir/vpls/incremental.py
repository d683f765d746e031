"""VPLs that outlive their frame while their light, a spotlight or a point, moves (Laine et al. 2007, "Incremental
Instant Radiosity", EGSR).

Each VPL has a site in the disc of the light's directions, on which equal areas get equal light. In each frame the
sites that the light no longer reaches are removed, and a few new ones fill the largest holes. Each carries the light of
its Voronoi cell, so all of the light is accounted for however many sites there are.

A ray that hits nothing keeps its site: the light of its cell is lost, and the hole is not tried again.

Moving models: VPLs that a model hides from the light are removed. A VPL on a model moves with it: its site and its
visibility from the light follow at once, but it is shaded from where its map was last drawn, until there is budget to
redraw the map.
"""

from __future__ import annotations

import numpy as np

from deferred_ir.base.arrays import Array, Bools, Ints
from deferred_ir.base.versions import new_versions
from deferred_ir.rays.tracer import Tracer
from deferred_ir.sampling import streams
from deferred_ir.sampling.disc_voronoi import VoronoiCells, find_most_crowded
from deferred_ir.sampling.warps import build_basis
from deferred_ir.sampling.warps import square_to_disc as unit_disc
from deferred_ir.scene.vertices import transform_points
from deferred_ir.vpls.cast import Vpls
from deferred_ir.vpls.emission_disc import EmissionDisc, KeptLight, find_axis, make_disc
from deferred_ir.vpls.kernel import cosine_ratio
from deferred_ir.vpls.stale_maps import StaleMaps

BETTER = 1.05
"""How much farther its nearest neighbour must be for a site to be moved. Above 1, so that moving comes to an end."""
MARGIN = 0.9
"""Distance of new sites from the rim, times the root of the number of sites: about half the distance between them."""
RESERVED = 8
"""One in this many maps of a frame is reserved for redrawing stale ones; new VPLs come first, for a hole is worse."""
FARTHEST = 0.1
"""Distance between a VPL and where it is shaded from beyond which it is removed, in diagonals."""
GOLDEN = np.array([0.7548776662466927, 0.5698402909980532])
"""Steps of the additive sequence in the unit square whose points keep apart best (Roberts 2018, R2)."""


class IncrementalVpls:
    """Up to `count` sites, and the surfaces that the rays through them hit. Slot i holds its VPL until it is removed.

    The same `seed` and the same frames give the same VPLs again. at_rest: the last frame changed no site and left no
    map stale, so while nothing moves, the next one changes nothing either.
    """

    at_rest = False

    def __init__(self, count: int, seed: int = 0) -> None:
        self._rng = streams.incremental_vpls(seed)
        self._offset, self._born = self._rng.random(2), 0
        self._right: Array = np.zeros(3)
        self._maps, self._group = StaleMaps(count), np.zeros(count, np.intp)
        self.weights = np.zeros(count)
        self.used = np.zeros(count, bool)
        self.landed = np.zeros(count, bool)
        self.version = np.zeros(count, np.int64)
        self.start = np.zeros((count, 2))
        self.direction, self.position, self.normal, self.shading_normal, self.albedo = np.zeros((5, count, 3))
        # VPLs on moving models are shaded from where their map was last drawn, until it is redrawn.
        self.shaded_position, self.shaded_normal = np.zeros((2, count, 3))

    def update(self, light: KeptLight, tracer: Tracer, *, least: int, most: int) -> Vpls:
        """Advance to the next frame. Returns its VPLs, `ray` being their slots.

        most: new and stale maps that the frame may draw; 1 in RESERVED is for stale ones, if there are any. least:
        sites that may be new or moved to where they are of more use, within `most`.
        """
        self._turn_basis(light)
        disc = make_disc(light, self._axes(light))
        self._begin_frame(light, tracer, disc)
        budget, most = most, most - min(most // RESERVED, int(self._maps.stale.sum()))
        slots = np.flatnonzero(self.used)
        cells = VoronoiCells(disc.project(self.direction[slots]))
        free = np.flatnonzero(~self.used)[:most]
        for _ in free:
            cells.add(self._find_hole(cells)[0])
        slots = np.concatenate([slots, free])
        cells, moved = self._spread(cells, min(least, most) - len(free))
        slots = np.append(np.delete(slots, moved), slots[moved])
        fresh = np.union1d(free, slots[len(slots) - len(moved) :])
        self.weights[:] = 0
        self.weights[slots] = cells.areas()
        place = np.zeros((len(self.used), 2))
        place[slots] = cells.sites
        self._shoot(light, tracer, fresh, disc.unproject(place[fresh]))
        redrawn = self._maps.find_worst(self.weights * self.albedo.sum(axis=1), budget - len(fresh))
        self.version[redrawn] = new_versions(len(redrawn))
        drawn = np.union1d(fresh, redrawn)
        self._maps.mark_drawn(drawn)
        self.shaded_position[drawn], self.shaded_normal[drawn] = self.position[drawn], self.normal[drawn]
        self.at_rest = not len(fresh) and not self._maps.stale.any()
        return self._make_vpls(light, disc.power)

    @property
    def waiting(self) -> int:
        """How many sites the budget has not allowed so far."""
        return int((~self.used).sum())

    def _begin_frame(self, light: KeptLight, tracer: Tracer, disc: EmissionDisc) -> None:
        """Move VPLs with their models, remove those that the light no longer reaches, and age the others' maps."""
        geometry = tracer.scene.geometry
        moves = self._maps.follow(geometry)
        for number, move in moves.items():
            own = np.flatnonzero(self.landed & (self._group == number + 1))
            self.position[own] = transform_points(self.position[own], move)
            for normals in (self.normal, self.shading_normal):
                normals[own] = normals[own] @ move[:3, :3].T
        self.used &= self._find_reached(light, tracer, disc) & (self._measure_lag() <= FARTHEST * geometry.diagonal)
        on_moved = np.isin(self._group, np.array(list(moves), int) + 1)
        changed = self._maps.find_changed(self.shaded_position, self.shaded_normal)
        self._maps.age(changed, on_moved, self.shaded_position)
        self._maps.stale &= self._find_alive()

    def _measure_lag(self) -> Array:
        """Return how far each VPL is from where it is shaded from, (count,)."""
        lag: Array = np.linalg.norm(self.position - self.shaded_position, axis=1) * (self._group > 0)
        return lag

    def _find_alive(self) -> Bools:
        """Return which slots have a VPL, and so a map, bool (count,)."""
        alive: Bools = self.used & self.landed & (self.albedo > 0).any(axis=1)
        return alive

    def _turn_basis(self, light: KeptLight) -> None:
        """Turn the disc's basis along with the axis, so that points of a disc light keep their places on it."""
        axis = find_axis(light)
        right = self._right - (self._right @ axis) * axis
        length = np.linalg.norm(right)
        self._right = right / length if length > 0.1 else build_basis(axis)[0]

    def _axes(self, light: KeptLight) -> Array:
        return np.stack([self._right, np.cross(find_axis(light), self._right)])

    def _origins(self, light: KeptLight) -> Array:
        origins: Array = np.asarray(light.position, float) + light.radius * self.start @ self._axes(light)
        return origins

    def _find_reached(self, light: KeptLight, tracer: Tracer, disc: EmissionDisc) -> Bools:
        """Update the sites' directions, and return which of those in use the light still reaches, bool (count,)."""
        chosen = np.flatnonzero(self.used & self.landed)
        origins = self._origins(light)
        way = self.position[chosen] - origins[chosen]
        distance = np.linalg.norm(way, axis=1)
        self.direction[chosen] = way / np.maximum(distance, 1e-300)[:, None]
        reached: Bools = disc.inside(self.direction)
        reached[chosen] &= (self.direction[chosen] * self.normal[chosen]).sum(axis=1) < 0
        reached[chosen] &= distance > tracer.offset
        seen = np.flatnonzero(reached & self.used & self.landed)
        reached[seen] &= ~tracer.occluded(
            origins[seen], tracer.lift(self.position[seen], self.normal[seen]), lifted=True
        )
        missed = np.flatnonzero(reached & self.used & ~self.landed)
        reached[missed] &= ~tracer.closest(origins[missed], self.direction[missed]).hit
        return reached

    def _find_hole(self, cells: VoronoiCells) -> tuple[Array, float]:
        """Return where the next site goes, (2,), and how far it is from the others."""
        if not len(cells.sites):
            return unit_disc(self._rng.random((1, 2)))[0] / 2, np.inf
        return cells.find_emptiest_circle(1 - MARGIN / np.sqrt(len(cells.sites) + 1))

    def _spread(self, cells: VoronoiCells, most: int) -> tuple[VoronoiCells, list[int]]:
        """Move up to `most` of the most crowded sites to where there is most room.

        Returns the cells, those that were moved last, and the rows that these had before. The shortest distance between
        sites grows, or fewer sites are as close, so with a still light it comes to an end.
        """
        count = min(most, len(cells.sites) - 1)
        while count > 0:
            left, gone, near, far = np.arange(len(cells.sites)), list[int](), list[float](), list[float]()
            for _ in range(count):
                row, distance = find_most_crowded(cells.sites[left])
                gone.append(int(left[row]))
                near.append(distance)
                left = np.delete(left, row)
            other = VoronoiCells(cells.sites[left])
            for _ in range(count):
                site, distance = self._find_hole(other)
                other.add(site)
                far.append(distance)
            worth = next((i for i in range(count) if far[i] <= BETTER * near[i]), count)
            if worth == count:
                return other, gone
            count = worth
        return cells, []

    def _shoot(self, light: KeptLight, tracer: Tracer, slots: Ints, directions: Array) -> None:
        """Trace a ray along each of `directions` (m, 3) and store what it hits in `slots` (m,)."""
        order = self._born + np.arange(len(slots))
        self._born += len(slots)
        self.start[slots] = unit_disc((self._offset + np.multiply.outer(order, GOLDEN)) % 1)
        self.direction[slots] = directions
        hits = tracer.closest(self._origins(light)[slots], directions)
        self.used[slots], self.landed[slots] = True, hits.hit
        self._group[slots] = np.where(hits.hit, tracer.scene.geometry.groups[hits.face], 0)
        self.position[slots], self.albedo[slots] = hits.position, hits.reflect_diffusely(directions)
        self.normal[slots], self.shading_normal[slots] = hits.normal, hits.shading_normal
        self.version[slots] = new_versions(len(slots))

    def _make_vpls(self, light: KeptLight, power: float) -> Vpls:
        """Return the VPLs that are alive, each with the light of its cell."""
        slots = np.flatnonzero(self._find_alive())
        direction = self.direction[slots]
        power_of_cells = np.multiply.outer(power * self.weights[slots], np.asarray(light.emission, float))
        ratio = cosine_ratio(self.normal[slots], self.shading_normal[slots], direction)
        emission = power_of_cells * self.albedo[slots] * ratio[:, None]
        return Vpls(self.shaded_position[slots], self.shaded_normal[slots], emission, slots)
