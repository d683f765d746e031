"""Light from all around, constant or by an image: what the camera sees behind everything."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from deferred_ir.base.arrays import Array, Vec3
from deferred_ir.base.colour import LUMINANCE
from deferred_ir.sampling.warps import disc_to_square, square_to_sphere
from deferred_ir.scene.environment_image import EnvironmentImage, read_image
from deferred_ir.scene.lights.base import Arrivals, Bounds, Flux, LightSamples, Meetings, end_outside, enter
from deferred_ir.scene.lights.fields import CheckedLight, Fault
from deferred_ir.scene.outlines import draw_arrow, draw_circle


@dataclass(frozen=True)
class Environment(CheckedLight):
    """image: a file (.hdr, .exr, .png), an array (H, W, 3) or an EnvironmentImage; or radiance: constant, linear RGB.

    rotation: degrees about +y; at 90 the middle of the image lies at -x. scale: factor on radiance.
    """

    kind: ClassVar[str] = "environment"
    at_infinity: ClassVar[bool] = True
    motion: ClassVar[None] = None
    image: Any = None
    radiance: Vec3 | None = None
    rotation: float = 0.0
    scale: float = 1.0

    def __post_init__(self) -> None:
        """Read the image. Raises SceneError."""
        if isinstance(self.image, str | os.PathLike):
            object.__setattr__(self, "image", read_image(self.image))
        elif self.image is not None and not isinstance(self.image, EnvironmentImage):
            object.__setattr__(self, "image", EnvironmentImage(self.image))
        super().__post_init__()

    def find_faults(self) -> Iterator[Fault]:
        """Yield what is wrong with the values."""
        if (self.image is None) == (self.radiance is None):
            what = "missing; give it, or radiance" if self.image is None else "give either image or radiance, not both"
            yield "image", what
        yield from self.find_number_faults("rotation", -math.inf)
        yield from self.find_number_faults("scale", 0)

    @property
    def emission(self) -> Vec3:
        """Its radiance where that is constant, else the factor on its image."""
        red, green, blue = (1.0, 1.0, 1.0) if self.radiance is None else self.radiance
        return self.scale * red, self.scale * green, self.scale * blue

    @property
    def has_area(self) -> bool:
        """It lies all around."""
        return True

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of its image; one pixel where it is constant."""
        if self.image is None:
            return 1, 1
        height, width = self.image.pixels.shape[:2]
        return width, height

    def look_up(self, directions: Array) -> Array:
        """Return its radiance in unit `directions` (n, 3), float64 (n, 3)."""
        values = np.ones((len(directions), 3)) if self.image is None else self.image.look_up(self._turn(directions, -1))
        radiance: Array = values * self.emission
        return radiance

    def _turn(self, directions: Array, sign: int) -> Array:
        """Return directions (n, 3) turned about +y by `rotation`, or back where `sign` is -1."""
        angle = sign * math.radians(self.rotation)
        x, y, z = directions.T
        turned: Array = np.stack(
            [x * math.cos(angle) + z * math.sin(angle), y, z * math.cos(angle) - x * math.sin(angle)], axis=1
        )
        return turned

    def _draw(self, square: Array) -> tuple[Array, Array, Array]:
        """Return unit directions towards it (n, 3), radiance over emission and density, (n, 3), and the density, (n,).

        The density is over solid angle.
        """
        if self.image is None:
            over = 4 * np.pi
            return square_to_sphere(square), np.full((len(square), 3), over), np.full(len(square), 1 / over)
        local, density = self.image.draw(square)
        return self._turn(local, 1), self.image.look_up(local) / density[:, None], density

    def emit(self, points: Array, places: Array | None, bounds: Bounds) -> Flux:
        """Return rays from all around: `points` say where they enter, `places` from where they come."""
        assert places is not None
        to, weight, _ = self._draw(disc_to_square(places))
        carried = weight * self.emission * (bounds.radius**2 / len(points))
        return enter(-to, points, bounds), -to, carried

    def measure_flux(self, bounds: Bounds) -> float:
        """Return the luminous flux over pi through discs about the scene that face it."""
        luminance = float(LUMINANCE @ np.asarray(self.emission))
        if self.image is not None:
            luminance = self.image.flux * self.scale
        else:
            luminance *= 4 * math.pi
        return luminance * bounds.radius**2

    def spread(self, square: Array, bounds: Bounds) -> LightSamples:
        """Return directions that stand for it; positions lie on the bounds."""
        to, weight, _ = self._draw(square)
        return LightSamples(np.asarray(bounds.centre) + bounds.radius * to, -to, weight * self.emission / len(square))

    def sample(self, at: Array, places: Array | None, bounds: Bounds) -> Arrivals:
        """Return what arrives from one direction each."""
        assert places is not None
        to, weight, density = self._draw(disc_to_square(places))
        return Arrivals(to, end_outside(at, to, bounds), weight, density)

    def meet(self, origins: Array, directions: Array) -> Meetings:
        """Return that every ray meets it, far away."""
        density = np.full(len(origins), 1 / (4 * np.pi))
        if self.image is not None:
            density = self.image.find_density(self._turn(directions, -1))
        return Meetings(np.full(len(origins), np.finfo(float).max), self.look_up(directions), density)

    def at(self, time: float) -> Environment:
        """Return itself: it does not move."""
        del time
        return self

    def translate(self, by: Vec3) -> Environment:
        """Return itself: it is infinitely far."""
        del by
        return self

    def outline(self, bounds: Bounds) -> Array:
        """Return a level circle below the scene, and an arrow to where the middle of its image lies."""
        middle = self._turn(np.array([[0.0, 0.0, -1.0]]), 1)[0]
        up = np.array([0.0, 1.0, 0.0])
        foot = (bounds.centre - bounds.radius / 2 * up).tolist()
        return np.concatenate([draw_circle(foot, up, bounds.radius), draw_arrow(foot, middle, bounds.radius)])


LIGHT = Environment
