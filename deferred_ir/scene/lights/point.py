"""A point that shines all around with constant intensity, or a ball that does: glTF's `point`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from deferred_ir.base.arrays import Array, Vec3
from deferred_ir.base.colour import LUMINANCE
from deferred_ir.sampling.warps import disc_to_sphere, lift_to_hemisphere
from deferred_ir.scene.lights.base import Arrivals, Bounds, Flux, LightView, aim
from deferred_ir.scene.lights.fields import Fault, PlacedLight
from deferred_ir.scene.lights.sphere import sample_ball
from deferred_ir.scene.motion import LightMotion
from deferred_ir.scene.outlines import SIZE, draw_ball, draw_cross

FACES = np.concatenate([np.eye(3), -np.eye(3)])
"""Where the views of its cube look."""
FACE_FOV = 91.0
"""Opening angle of a view, degrees: a little more than a face's 90, so that filters find texels beyond its edges."""


@dataclass(frozen=True)
class Point(PlacedLight):
    """position: world space; intensity: W/sr, linear RGB; radius: of a ball of that intensity, for soft shadows."""

    kind: ClassVar[str] = "point"
    view_halvings: ClassVar[tuple[int, ...]] = (1,) * 6
    position: Vec3
    intensity: Vec3 = (1.0, 1.0, 1.0)
    radius: float = 0.0
    motion: LightMotion | None = None

    def find_faults(self) -> Iterator[Fault]:
        """Yield what is wrong with the values."""
        yield from super().find_faults()
        yield from self.find_number_faults("radius", 0)

    @property
    def emission(self) -> Vec3:
        """Its intensity."""
        return self.intensity

    @property
    def has_area(self) -> bool:
        """Whether it is a ball."""
        return self.radius > 0

    def emit(self, points: Array, places: Array | None, bounds: Bounds) -> Flux:
        """Return rays in all directions."""
        del bounds
        carried = np.tile(np.asarray(self.intensity, float) * (4 / len(points)), (len(points), 1))
        middle = np.broadcast_to(np.asarray(self.position, float), (len(points), 3))
        if places is None:
            return middle, disc_to_sphere(points), carried
        normals = disc_to_sphere(places)
        return middle + self.radius * normals, lift_to_hemisphere(points, normals), carried

    def measure_flux(self, bounds: Bounds) -> float:
        """Return its luminous flux over pi."""
        del bounds
        return float(4 * (LUMINANCE @ np.asarray(self.intensity, float)))

    def sample(self, at: Array, places: Array | None, bounds: Bounds) -> Arrivals:
        """Return what arrives; nothing inside a ball."""
        del bounds
        source = np.asarray(self.position, float)
        if places is None:
            to, square = aim(source, at)
            return Arrivals(to, np.broadcast_to(source, at.shape), 1 / square)
        found = sample_ball(source, self.radius, at, places)
        return Arrivals(found.to, found.ends, found.strength / (np.pi * self.radius**2))

    def describe(self) -> Mapping[str, Any]:
        """Return its fields of a LIGHT record."""
        return {"position": self.position, "radius": self.radius, "emission": self.intensity}

    def list_views(self, bounds: Bounds) -> tuple[LightView, ...]:
        """Return the faces of a cube about it."""
        del bounds
        return tuple(LightView(self.position, face, FACE_FOV, halvings=self.view_halvings[0]) for face in FACES)

    def outline(self, bounds: Bounds) -> Array:
        """Return a cross, and its ball."""
        cross = draw_cross(self.position, SIZE / 2 * bounds.radius)
        return np.concatenate([cross, draw_ball(self.position, self.radius)]) if self.radius else cross


LIGHT = Point
