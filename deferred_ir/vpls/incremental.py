"""VPLs that outlive their frame while the spotlight moves (Laine et al. 2007, "Incremental Instant Radiosity", EGSR).

A VPL is a site in the disc of directions that the spotlight sends light to, in which equal areas get equal light. Each
frame sites that the light no longer reaches are given up at once, and a few new ones fill the largest holes; each
carries the light of its Voronoi cell, so all of the light is accounted for however many sites there are.

A ray that misses stands for its site, too: the light of its cell is lost, and the hole is not tried again.

Where models move, VPLs that they hide from the light are given up. Those on them go with them: sites and validity at
once, their light when there is budget for its map. Until then it shines from where it was.
"""

from __future__ import annotations

import numpy as np

from deferred_ir.base.arrays import Array, Bools, Ints
from deferred_ir.base.versions import new_version, new_versions
from deferred_ir.rays.tracer import Tracer
from deferred_ir.sampling import streams
from deferred_ir.sampling.disc_voronoi import Cells, most_crowded
from deferred_ir.sampling.warps import build_basis
from deferred_ir.sampling.warps import square_to_disc as unit_disc
from deferred_ir.scene.geometry import transform_points
from deferred_ir.scene.lights.spot import Spotlight
from deferred_ir.vpls.cast import Vpls
from deferred_ir.vpls.emission_disc import EmissionDisc
from deferred_ir.vpls.kernel import cosine_ratio
from deferred_ir.vpls.stale_maps import StaleMaps

BETTER = 1.05
"""A site is moved if its nearest neighbour will be farther by this factor. Above 1, so that it comes to an end."""
MARGIN = 0.9
"""New sites stay off the rim by this, over the root of their number: about half their distance from one another."""
RESERVED = 8
"""One map in so many is for VPLs that are there already, however many are new: a hole is worse than a map that lags."""
FARTHEST = 0.1
"""VPLs on moving models that shine from farther behind than this, in diagonals, are given up."""
GOLDEN = np.array([0.7548776662466927, 0.5698402909980532])
"""Steps of the additive sequence in the unit square whose points keep apart best (Roberts 2018, R2)."""


class IncrementalVpls:
    """At most `count` sites and what the rays through them met. Slot i keeps its VPL until that is given up.

    The same `seed` and the same frames give the same VPLs again. at_rest: the last frame changed no site and left no
    map stale, so the next one will not change anything either if nothing moves.
    """

    at_rest = False

    def __init__(self, count: int, seed: int = 0) -> None:
        self._rng = streams.incremental_vpls(seed)
        self._offset, self._born = self._rng.random(2), 0
        self._right: Array = np.zeros(3)
        self._spot: tuple[object, int] = None, 0
        self._maps, self._group = StaleMaps(count), np.zeros(count, np.intp)
        self.weights = np.zeros(count)
        self.used = np.zeros(count, bool)
        self.landed = np.zeros(count, bool)
        self.version = np.zeros(count, np.int64)
        self.start = np.zeros((count, 2))
        self.direction, self.position, self.normal, self.shading_normal, self.albedo = np.zeros((5, count, 3))
        # Of those on moving models, where they were when their maps were drawn: there they shine from.
        self.shown, self.shown_normal = np.zeros((2, count, 3))

    def update(self, light: Spotlight, tracer: Tracer, *, least: int, most: int) -> Vpls:
        """The VPLs of the next frame, `ray` being their slots.

        light: where it is now. most: maps that may be drawn, of new sites or of those that show a model where it was;
        1 in RESERVED is the latter's if they need it. least: sites that may be new or moved to where they are of more
        use, as far as `most` goes.
        """
        self._turn(light)
        disc = EmissionDisc(light, self._axes(light))
        self._give_up(light, tracer, disc)
        whole, most = most, most - min(most // RESERVED, int(self._maps.stale.sum()))
        slots = np.flatnonzero(self.used)
        cells = Cells(disc.project(self.direction[slots]))
        free = np.flatnonzero(~self.used)[:most]
        for _ in free:
            cells.add(self._hole(cells)[0])
        slots = np.concatenate([slots, free])
        cells, moved = self._spread(cells, min(least, most) - len(free))
        slots = np.append(np.delete(slots, moved), slots[moved])
        fresh = np.union1d(free, slots[len(slots) - len(moved) :])
        self.weights[:] = 0
        self.weights[slots] = cells.shares()
        place = np.zeros((len(self.used), 2))
        place[slots] = cells.sites
        self._shoot(light, tracer, fresh, disc.unproject(place[fresh]))
        again = self._maps.worst(self.weights * self.albedo.sum(axis=1), whole - len(fresh))
        self.version[again] = new_versions(len(again))
        drawn = np.union1d(fresh, again)
        self._maps.drawn(drawn)
        self.shown[drawn], self.shown_normal[drawn] = self.position[drawn], self.normal[drawn]
        self.at_rest = not len(fresh) and not self._maps.stale.any()
        return self._lit(light, disc.power)

    @property
    def waiting(self) -> int:
        """Rays that the budget has not allowed so far."""
        return int((~self.used).sum())

    def _give_up(self, light: Spotlight, tracer: Tracer, disc: EmissionDisc) -> None:
        """Begin a frame: VPLs go with their models; those that are not reached any more go, and maps become stale."""
        geometry = tracer.scene.geometry
        moves = self._maps.follow(geometry)
        for number, move in moves.items():
            own = np.flatnonzero(self.landed & (self._group == number + 1))
            self.position[own] = transform_points(self.position[own], move)
            for normals in (self.normal, self.shading_normal):
                normals[own] = normals[own] @ move[:3, :3].T
        self.used &= self._reached(light, tracer, disc) & (self._lag() <= FARTHEST * geometry.diagonal)
        on_moved = np.isin(self._group, np.array(list(moves), int) + 1)
        self._maps.age(self._maps.see(self.shown, self.shown_normal), on_moved, self.shown)
        self._maps.stale &= self._shines()
        if self._maps.see(np.array([light.position]), light.axis[None]).any():
            self._spot = None, 0

    def _lag(self) -> Array:
        """How far each VPL is from where it shines from, (count,)."""
        lag: Array = np.linalg.norm(self.position - self.shown, axis=1) * (self._group > 0)
        return lag

    def _shines(self) -> Bools:
        """Which slots have a VPL, and so a map."""
        shines: Bools = self.used & self.landed & (self.albedo > 0).any(axis=1)
        return shines

    def spot_version(self, light: Spotlight) -> int:
        """A number that changes when the spotlight sees something else than before."""
        view = (light.position, light.look_at, light.fov)
        if view != self._spot[0]:
            self._spot = view, new_version()
        return self._spot[1]

    def _turn(self, light: Spotlight) -> None:
        """Carry the disc's frame along with the axis, so that points of a disc light stay where they are on it."""
        right = self._right - (self._right @ light.axis) * light.axis
        length = np.linalg.norm(right)
        self._right = right / length if length > 0.1 else build_basis(light.axis)[0]

    def _axes(self, light: Spotlight) -> Array:
        return np.stack([self._right, np.cross(light.axis, self._right)])

    def _origins(self, light: Spotlight) -> Array:
        origins: Array = np.asarray(light.position, float) + light.radius * self.start @ self._axes(light)
        return origins

    def _reached(self, light: Spotlight, tracer: Tracer, disc: EmissionDisc) -> Bools:
        """Which sites in use the light still reaches as it did; their directions are those from where it is now."""
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

    def _hole(self, cells: Cells) -> tuple[Array, float]:
        """Where the next site goes, and how far it is from the others."""
        if not len(cells.sites):
            return unit_disc(self._rng.random((1, 2)))[0] / 2, np.inf
        return cells.emptiest(1 - MARGIN / np.sqrt(len(cells.sites) + 1))

    def _spread(self, cells: Cells, most: int) -> tuple[Cells, list[int]]:
        """Up to `most` of the most crowded sites put where there is most room, and their rows before; they come last.

        The shortest distance between sites grows or fewer are as close, so with a still light it comes to an end.
        """
        count = min(most, len(cells.sites) - 1)
        while count > 0:
            left, gone, near, far = np.arange(len(cells.sites)), list[int](), list[float](), list[float]()
            for _ in range(count):
                row, distance = most_crowded(cells.sites[left])
                gone.append(int(left[row]))
                near.append(distance)
                left = np.delete(left, row)
            other = Cells(cells.sites[left])
            for _ in range(count):
                site, distance = self._hole(other)
                other.add(site)
                far.append(distance)
            worth = next((i for i in range(count) if far[i] <= BETTER * near[i]), count)
            if worth == count:
                return other, gone
            count = worth
        return cells, []

    def _shoot(self, light: Spotlight, tracer: Tracer, slots: Ints, directions: Array) -> None:
        """Rays along `directions` (m, 3), into `slots`."""
        order = self._born + np.arange(len(slots))
        self._born += len(slots)
        self.start[slots] = unit_disc((self._offset + np.multiply.outer(order, GOLDEN)) % 1)
        self.direction[slots] = directions
        hits = tracer.closest(self._origins(light)[slots], directions)
        self.used[slots], self.landed[slots] = True, hits.hit
        self._group[slots] = np.where(hits.hit, tracer.scene.geometry.groups[hits.face], 0)
        self.position[slots], self.albedo[slots] = hits.position, hits.albedo
        self.normal[slots], self.shading_normal[slots] = hits.normal, hits.shading_normal
        self.version[slots] = new_versions(len(slots))

    def _lit(self, light: Spotlight, power: float) -> Vpls:
        """What is there; each VPL carries the light of its cell."""
        slots = np.flatnonzero(self._shines())
        direction = self.direction[slots]
        power_of_cells = np.multiply.outer(power * self.weights[slots], np.asarray(light.emission, float))
        ratio = cosine_ratio(self.normal[slots], self.shading_normal[slots], direction)
        emission = power_of_cells * self.albedo[slots] * ratio[:, None]
        return Vpls(self.shown[slots], self.shown_normal[slots], emission, slots)
