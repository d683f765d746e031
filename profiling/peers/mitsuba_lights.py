"""Conversion of lights of every kind to Mitsuba's emitters.

What has an area is a shape there, which is seen and hides what lies behind; a sun's disc is one far away.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from deferred_ir.base.arrays import Array
from deferred_ir.base.errors import SettingError
from deferred_ir.sampling.warps import build_basis
from deferred_ir.scene.lights.directional import Directional
from deferred_ir.scene.lights.disc import Disc
from deferred_ir.scene.lights.environment import Environment
from deferred_ir.scene.lights.point import Point
from deferred_ir.scene.lights.rect import Rect
from deferred_ir.scene.lights.sphere import Sphere
from deferred_ir.scene.lights.spot import Spot
from deferred_ir.scene.lights.spotlight import Spotlight
from deferred_ir.scene.scene import Scene

CONE_TEXELS = (1024, 4096)
"""Least and most texels along an edge of the projected texture."""
CONE_STEP = 0.1
"""Largest step between texels, as a tangent; linear interpolation then errs by at most 0.13 % on the axis."""
FAR_DISC = 1e4
"""Distance of a sun's disc, in diagonals of the scene."""
SKY_ROWS = 1024
"""Least rows of an image of the environment: its texels lie elsewhere than ours, so that it is resampled finely."""


def convert_lights(mi: Any, scene: Scene) -> dict[str, Any]:
    """Return the emitters of a scene by name. Raises SettingError for lights that Mitsuba does not have."""
    if sum(isinstance(light, Environment) for light in scene.lights) > 1:
        raise SettingError("mitsuba: has one environment, and this scene has more; leave it out by --peers")
    shining = [light for light in scene.lights if any(light.emission)]
    return {f"light_{number}": _CONVERSIONS[light.kind](mi, light, scene) for number, light in enumerate(shining)}


def _convert_spot(mi: Any, light: Spot | Spotlight, scene: Scene) -> dict[str, Any]:
    """Convert a light with a cone to one that projects its profile as a texture."""
    del scene
    if isinstance(light, Spotlight) and light.radius > 0:
        raise SettingError("mitsuba: its spotlight has no radius, and this scene's has; leave it out by --peers")
    return {
        "type": "spot",
        "to_world": _look(mi, light.position, light.axis),
        "intensity": make_rgb(light.emission),
        "cutoff_angle": light.fov / 2,
        "beam_width": light.fov / 2,  # no falloff of its own
        "texture": make_bitmap(mi, _profile(light)[..., None], wrap="clamp"),
    }


def _profile(light: Spot | Spotlight) -> Array:
    """Return intensity over that along the axis, over the light's image plane up to tan(fov/2), float32 (n, n)."""
    tangent = np.tan(np.radians(light.fov) / 2)
    least, most = CONE_TEXELS
    texels = least
    while 2 * tangent / texels > CONE_STEP:
        texels *= 2
        if texels > most:
            raise SettingError(
                f"mitsuba: a {light.kind} of {light.fov:g} degrees is too wide for the texture that it projects"
            )
    x = ((np.arange(texels) + 0.5) / texels * 2 - 1) * tangent
    right, up = build_basis(light.axis)
    ways = x[:, None] * right + x[:, None, None] * up + light.axis
    ways /= np.linalg.norm(ways, axis=-1, keepdims=True)
    profile: Array = light.radiate(ways).astype(np.float32)
    return profile


def _convert_point(mi: Any, light: Point, scene: Scene) -> dict[str, Any]:
    del mi, scene
    if light.radius == 0:
        return {"type": "point", "position": list(light.position), "intensity": make_rgb(light.intensity)}
    radiance = np.asarray(light.intensity) / (np.pi * light.radius**2)
    return {"type": "sphere", "center": list(light.position), "radius": light.radius, **_shine(radiance)}


def _convert_directional(mi: Any, light: Directional, scene: Scene) -> dict[str, Any]:
    if light.angle == 0:
        return {
            "type": "directional",
            "direction": light.axis.tolist(),
            "irradiance": make_rgb(light.irradiance),
        }
    distance, half = FAR_DISC * scene.geometry.diagonal, np.radians(light.angle) / 2
    place = np.asarray(scene.bounds.centre) - distance * light.axis
    scale = mi.ScalarTransform4f().scale(float(distance * np.tan(half)))
    radiance = np.asarray(light.irradiance) / (np.pi * np.sin(half) ** 2)
    return {"type": "disk", "to_world": _look(mi, place.tolist(), light.axis) @ scale, **_shine(radiance)}


def _convert_rect(mi: Any, light: Rect, scene: Scene) -> dict[str, Any]:
    del scene
    across, along = light.size
    look = _look(mi, light.position, light.axis, light.up)
    scaled = look @ mi.ScalarTransform4f().scale([across / 2, along / 2, 1.0])
    return {"type": "rectangle", "to_world": scaled, **_shine(light.radiance)}


def _convert_disc(mi: Any, light: Disc, scene: Scene) -> dict[str, Any]:
    del scene
    scaled = _look(mi, light.position, light.axis) @ mi.ScalarTransform4f().scale(light.radius)
    return {"type": "disk", "to_world": scaled, **_shine(light.radiance)}


def _convert_sphere(mi: Any, light: Sphere, scene: Scene) -> dict[str, Any]:
    del mi, scene
    return {"type": "sphere", "center": list(light.position), "radius": light.radius, **_shine(light.radiance)}


def _convert_environment(mi: Any, light: Environment, scene: Scene) -> dict[str, Any]:
    del scene
    if light.image is None:
        return {"type": "constant", "radiance": make_rgb(light.emission)}
    height = max(light.image.pixels.shape[0], SKY_ROWS)
    # Its columns start at -z, where our image has its middle, and go the same way round; its rows end at the poles.
    azimuth = (np.arange(2 * height) + 0.5) / (2 * height) * 2 * np.pi
    polar = np.arange(height) / (height - 1) * np.pi
    ring, turn = np.meshgrid(polar, azimuth, indexing="ij")
    ways = np.stack([np.sin(ring) * np.sin(turn), np.cos(ring), -np.sin(ring) * np.cos(turn)], axis=-1)
    pixels = light.look_up(ways.reshape(-1, 3)).reshape(*ring.shape, 3).astype(np.float32)
    return {"type": "envmap", "bitmap": mi.Bitmap(pixels)}


_CONVERSIONS: dict[str, Callable[[Any, Any, Scene], dict[str, Any]]] = {
    Spotlight.kind: _convert_spot,
    Spot.kind: _convert_spot,
    Point.kind: _convert_point,
    Directional.kind: _convert_directional,
    Rect.kind: _convert_rect,
    Disc.kind: _convert_disc,
    Sphere.kind: _convert_sphere,
    Environment.kind: _convert_environment,
}


def _look(mi: Any, position: Sequence[float], axis: Array, up: Sequence[float] | None = None) -> Any:
    """Return the transform to world space of what stands at `position` and looks along unit `axis`."""
    target = np.add(position, axis)
    above = np.eye(3)[np.abs(axis).argmin()].tolist() if up is None else list(up)
    return mi.ScalarTransform4f().look_at(origin=list(position), target=target.tolist(), up=above)


def _shine(radiance: Sequence[float] | Array) -> dict[str, Any]:
    """Return the emitter of a shape that reflects nothing."""
    black = {"type": "diffuse", "reflectance": make_rgb((0.0, 0.0, 0.0))}
    return {"emitter": {"type": "area", "radiance": make_rgb(radiance)}, "bsdf": black}


def make_rgb(values: Sequence[float] | Array) -> dict[str, Any]:
    """Return a constant colour."""
    return {"type": "rgb", "value": [float(value) for value in values]}


def make_bitmap(mi: Any, pixels: Array, wrap: str = "repeat") -> dict[str, Any]:
    """Return a texture of linear values, float32 (H, W, 1 or 3)."""
    bitmap = mi.Bitmap(np.ascontiguousarray(pixels, np.float32))
    return {"type": "bitmap", "bitmap": bitmap, "raw": True, "filter_type": "bilinear", "wrap_mode": wrap}
