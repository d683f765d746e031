"""Records the path of camera and light as keyframes, which a scene file holds as motions."""

from __future__ import annotations

from dataclasses import replace

from deferred_ir.scene.camera import Camera
from deferred_ir.scene.lights.spotlight import Spotlight
from deferred_ir.scene.motion import CameraMotion, KeyframedLight
from deferred_ir.scene.scene import Scene

PERIOD = 0.2
"""Seconds between two keyframes."""


class Recorder:
    """Collects keyframes; their times are seconds since the first."""

    def __init__(self) -> None:
        self._keyframes: list[tuple[float, Camera, Spotlight]] = []
        self._start = 0.0

    def add(self, now: float, camera: Camera, light: Spotlight) -> None:
        """Add a keyframe at `now`, seconds of any clock, unless it comes too soon after the last one."""
        if not self._keyframes:
            self._start = now
        time = now - self._start
        if not self._keyframes or time >= self._keyframes[-1][0] + PERIOD:
            self._keyframes.append((round(time, 3), camera, light))

    def apply(self, scene: Scene) -> Scene:
        """Return `scene` with camera and light where the recording began, and with motions if they have moved."""
        if not self._keyframes:
            return scene
        times = tuple(time for time, _, _ in self._keyframes)
        cameras = [camera for _, camera, _ in self._keyframes]
        lights = [light for _, _, light in self._keyframes]
        camera, light = cameras[0], lights[0]
        if len(set(cameras)) > 1:
            path = CameraMotion(times, tuple(c.position for c in cameras), tuple(c.look_at for c in cameras))
            camera = replace(camera, motion=path)
        if len(set(lights)) > 1:
            way = KeyframedLight(times, tuple(x.position for x in lights), tuple(x.look_at for x in lights))
            light = replace(light, motion=way)
        return replace(scene, camera=camera, lights=(light,))
