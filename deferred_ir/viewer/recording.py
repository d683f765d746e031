"""Records the way of camera and light as keyframes, which a scene file holds as motions."""

from __future__ import annotations

from dataclasses import replace

from deferred_ir.scene.camera import Camera
from deferred_ir.scene.lights.spot import Spotlight
from deferred_ir.scene.motion import CameraMotion, KeyframedSpotlight
from deferred_ir.scene.scene import Scene

PERIOD = 0.2
"""Seconds between two keyframes."""


class Path:
    """Keyframes by time in seconds since the first."""

    def __init__(self) -> None:
        self._frames: list[tuple[float, Camera, Spotlight]] = []
        self._start = 0.0

    def add(self, now: float, camera: Camera, light: Spotlight) -> None:
        """Where both are at `now`; what comes too soon after the last keyframe is passed over."""
        if not self._frames:
            self._start = now
        time = now - self._start
        if not self._frames or time >= self._frames[-1][0] + PERIOD:
            self._frames.append((round(time, 3), camera, light))

    def applied(self, scene: Scene) -> Scene:
        """`scene` with the motions that were recorded: of what has moved."""
        if not self._frames:
            return scene
        times = tuple(time for time, _, _ in self._frames)
        cameras = [camera for _, camera, _ in self._frames]
        lights = [light for _, _, light in self._frames]
        camera, light = cameras[0], lights[0]
        if len(set(cameras)) > 1:
            motion = CameraMotion(times, tuple(c.position for c in cameras), tuple(c.look_at for c in cameras))
            camera = replace(camera, motion=motion)
        if len(set(lights)) > 1:
            way = KeyframedSpotlight(times, tuple(x.position for x in lights), tuple(x.look_at for x in lights))
            light = replace(light, motion=way)
        return replace(scene, camera=camera, spotlight=light)
