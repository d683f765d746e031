"""Records the paths of camera and lights as keyframes, which a scene file holds as motions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from deferred_ir.scene.camera import Camera
from deferred_ir.scene.lights.base import Light
from deferred_ir.scene.motion import CameraMotion, KeyframedLight
from deferred_ir.viewer.edits.lights import Entry

PERIOD = 0.2
"""Seconds between two keyframes."""


class Recorder:
    """Collects keyframes; their times are seconds since the first."""

    def __init__(self) -> None:
        self._times: list[float] = []
        self._cameras: list[Camera] = []
        self._lights: list[dict[int, Any]] = []
        self._start = 0.0

    def add(self, now: float, camera: Camera, entries: Sequence[Entry]) -> None:
        """Add a keyframe at `now`, seconds of any clock, unless it comes too soon after the last one."""
        if not self._times:
            self._start = now
        time = now - self._start
        if not self._times or time >= self._times[-1] + PERIOD:
            self._times.append(round(time, 3))
            self._cameras.append(camera)
            self._lights.append({entry.key: entry.light for entry in entries})

    def make_camera(self, now: Camera) -> Camera:
        """Return the camera where the recording began, with a motion if it has moved; `now` without keyframes."""
        if len(set(self._cameras)) < 2:
            return self._cameras[0] if self._cameras else now
        positions, look_ats = (tuple(getattr(c, name) for c in self._cameras) for name in ("position", "look_at"))
        return replace(self._cameras[0], motion=CameraMotion(tuple(self._times), positions, look_ats))

    def make_light(self, entry: Entry) -> Light:
        """Return a light of the list where it was first seen, with its old motion or a new one if it has moved."""
        found = [(time, at[entry.key]) for time, at in zip(self._times, self._lights, strict=True) if entry.key in at]
        lights = [light for _, light in found]
        positions, look_ats = (
            tuple(getattr(light, name) for light in lights if hasattr(light, name)) for name in ("position", "look_at")
        )
        if len(set(zip(positions, look_ats or positions, strict=True))) < 2:
            unmoved: Light = entry.with_motion
            return unmoved
        way = KeyframedLight(tuple(time for time, _ in found), positions, look_ats)
        start = {"look_at": look_ats[0]} if look_ats else {}
        moved: Light = replace(entry.light, position=positions[0], motion=way, **start)
        return moved
