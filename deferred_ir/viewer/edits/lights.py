"""The lights of a session: a list, one of which is selected, and how they are made and edited. Knows no window.

A kind's class is all that is known of it: its fields, and what every light answers.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import MISSING, dataclass, field, fields, replace
from itertools import count
from typing import Any

import numpy as np

from deferred_ir.base.arrays import Array, Vec3
from deferred_ir.base.colour import LUMINANCE
from deferred_ir.base.errors import SceneError
from deferred_ir.sampling.patterns import sample_unit_disc
from deferred_ir.scene.camera import Camera
from deferred_ir.scene.lights.base import Bounds, Light
from deferred_ir.scene.lights.fields import COLOURS

EXTENT = 0.1
"""Size of a new light with an area, over its distance from the camera."""
RAISED = 0.1
"""How much higher than the line of sight a new light is, over the same distance: its lines are seen from the side."""
SAMPLES = 64
"""Points of a light that say how bright it is."""


@dataclass(frozen=True, eq=False)
class Entry:
    """A light of the list.

    light: as it is now, at rest. origin: as it came into the list, with its motion. key: stays, whatever changes.
    """

    light: Any
    origin: Any
    on: bool = True
    key: int = field(default_factory=count().__next__)

    @property
    def with_motion(self) -> Any:
        """The light, with its motion if it is where that begins."""
        start, names = self.origin.at(0.0), _list_places(self.light)
        if self.origin.motion is None or any(getattr(self.light, name) != getattr(start, name) for name in names):
            return self.light
        return replace(self.light, **{name: getattr(self.origin, name) for name in (*names, "motion")})


class LightList:
    """All lights, on or off. selected: a number in the list. error: why the last edit was refused, "" if it was not.

    changed: called after each change of what shines.
    """

    def __init__(self, changed: Callable[[], None]) -> None:
        self._changed = changed
        self.entries: tuple[Entry, ...] = ()
        self.selected = 0
        self.error = ""

    @property
    def light(self) -> Any:
        """The selected light, None in an empty list."""
        return self.entries[self.selected].light if self.entries else None

    @property
    def shining(self) -> tuple[Light, ...]:
        """The lights that are on."""
        return tuple(entry.light for entry in self.entries if entry.on)

    def use(self, lights: Sequence[Light]) -> None:
        """Take the lights of a scene, where they are at the beginning of their motions; all of them are on."""
        self._set(tuple(Entry(light.at(0.0), light) for light in lights), 0)

    def restart(self, origins: Sequence[Light]) -> None:
        """Put each light where a new origin begins; which are on, and which one is selected, stays."""
        pairs = zip(self.entries, origins, strict=True)
        self._set(tuple(replace(entry, light=light.at(0.0), origin=light) for entry, light in pairs), self.selected)

    def follow(self, time: float) -> None:
        """Move the lights that have a motion to where they are at `time`, seconds. Raises LightError."""
        self._set(tuple(_follow(entry, time) for entry in self.entries), self.selected)

    def select(self, number: int) -> None:
        """Select a light by its number."""
        self._set(self.entries, number)

    def select_next(self) -> None:
        """Select the next light, after the last one the first."""
        self._set(self.entries, (self.selected + 1) % max(len(self.entries), 1))

    def switch(self, number: int) -> None:
        """Switch a light off, or on again as bright as it was."""
        entry = self.entries[number]
        self._swap(number, replace(entry, on=not entry.on))

    def put(self, light: Light) -> None:
        """Put a light in place of the selected one, or into an empty list."""
        if self.entries:
            self._swap(self.selected, replace(self.entries[self.selected], light=light))
        else:
            self.add(light)

    def edit(self, change: Callable[[Any], Light]) -> None:
        """Change the selected light; it stays as it was, and `error` tells, where its class refuses the values."""
        if not self.entries:
            return
        try:
            light = change(self.light)
        except SceneError as error:
            self.error = str(error)
        else:
            self.put(light)

    def add(self, light: Light) -> None:
        """Add a light at the end, and select it."""
        self._set((*self.entries, Entry(light, light)), len(self.entries))

    def duplicate(self, by: Vec3) -> None:
        """Add a copy of the selected light, moved by a vector."""
        if self.entries:
            self.add(self.light.translate(by))

    def remove(self) -> None:
        """Remove the selected light, and select the one that followed it."""
        entries = self.entries[: self.selected] + self.entries[self.selected + 1 :]
        self._set(entries, max(min(self.selected, len(entries) - 1), 0))

    def _swap(self, number: int, entry: Entry) -> None:
        self._set((*self.entries[:number], entry, *self.entries[number + 1 :]), self.selected)

    def _set(self, entries: tuple[Entry, ...], selected: int) -> None:
        self.entries, self.selected, self.error = entries, selected, ""
        self._changed()


def _list_places(light: Any) -> tuple[str, ...]:
    """Return the names of the fields that a motion sets."""
    return tuple(name for name in ("position", "look_at") if hasattr(light, name))


def _follow(entry: Entry, time: float) -> Entry:
    """Return an entry whose light is where its motion is at a time, otherwise as it is now."""
    if entry.origin.motion is None:
        return entry
    place = entry.origin.at(time)
    values = {name: getattr(place, name) for name in _list_places(entry.light)}
    return replace(entry, light=replace(entry.light, **values))


def set_field(light: Any, name: str, value: Any) -> Light:
    """Return a light with another value of a field. Raises SceneError.

    Fields that may be None stand for each other, as an environment's image and radiance do: the others become None.
    """
    choices = {one.name for one in fields(light) if one.default is None and one.name != "motion"}
    others = choices - {name} if name in choices else ()
    changed: Light = replace(light, **dict.fromkeys(others), **{name: value})
    return changed


def make_light(kind: Any, camera: Camera, way: float, shining: Sequence[Light], bounds: Bounds) -> Light:
    """Make a light of a kind half-way to what the middle of a picture shows, a little higher, that shines there.

    way: how far that is. At that place it is as bright as all of `shining` together, or brings an irradiance of 1.
    """
    _, up, forward = way * camera.axes
    end = np.asarray(camera.position) + forward
    middle = end - 0.5 * forward + RAISED * up
    size = EXTENT * way / 2
    known = {"position": middle.tolist(), "look_at": end.tolist(), "radius": size / 2, "size": (size, size)}
    own = {one.name: one for one in fields(kind)}
    colours = [name for name in own if name in COLOURS]
    values = {name: known[name] for name, one in own.items() if name in known and one.default is MISSING}
    values |= {"up": camera.up} if "up" in own else {}
    unit = kind(**values, **dict.fromkeys(colours, (1.0, 1.0, 1.0)))
    bright, each = (sum(_measure(light, end, bounds) for light in lights) for lights in (shining, [unit]))
    strength = (bright or 1.0) / each if each > 0 else 1.0
    made: Light = replace(unit, **dict.fromkeys(colours, (strength, strength, strength)))
    return made


def _measure(light: Light, at: Array, bounds: Bounds) -> float:
    """Return the mean luminance of irradiance that a light brings to a point, without shadows."""
    places = sample_unit_disc("sobol", SAMPLES, 0) if light.has_area else None
    points = np.tile(at, (len(places) if places is not None else 1, 1))
    strength = light.sample(points, places, bounds).strength.reshape(len(points), -1)
    return float((strength * light.emission).mean(axis=0) @ LUMINANCE)
