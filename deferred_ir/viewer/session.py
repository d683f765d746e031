"""What the viewer shows: a scene, its camera and light, a graph with settings, and the Renderer that draws them.

Knows neither window nor controls. A change costs what it must: frames are reused (deferred_ir/engine/reuse.py), so a
pass is skipped while its inputs are unchanged. Whatever fails leaves the last good picture, and `error`.
"""

from __future__ import annotations

import time as clock
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from deferred_ir.base.errors import Error, GraphError
from deferred_ir.engine.accumulation import Accumulation, readers
from deferred_ir.engine.measurement import Measurement
from deferred_ir.engine.renderer import IMAGES, Renderer
from deferred_ir.engine.settings import choose_settings
from deferred_ir.gl.devices import Loader
from deferred_ir.graph.graph import Plan
from deferred_ir.graph.roles import find_parameters
from deferred_ir.loading.load import load
from deferred_ir.output.exposure import automatic_stops
from deferred_ir.output.image import Image
from deferred_ir.scene.camera import Camera
from deferred_ir.scene.lights.spot import Spotlight
from deferred_ir.scene.motion import FRAMES_PER_SECOND
from deferred_ir.scene.scene import Scene
from deferred_ir.viewer.navigation import as_camera
from deferred_ir.viewer.noise import Noise
from deferred_ir.viewer.plan_changes import changed, exposed
from deferred_ir.viewer.recording import Path

FRAMES_KEPT = 240
"""Frame times that are kept for the plot."""


class Session:
    """One scene in one Renderer, on the context of `window`.

    size: (width, height) of the picture. settings: {"pass.param": value}. error: what last went wrong, "" if nothing.
    plan: what is to be drawn; drawn: what was, None where that failed.
    """

    def __init__(
        self,
        scene: Scene,
        size: tuple[int, int],
        window: Loader,
        *,
        graph: str = "deferred",
        settings: Mapping[str, Any] | None = None,
        seed: int = 0,
    ) -> None:
        self.graph, self.settings, self.seed = graph, dict(settings or {}), seed
        self.renderer = Renderer(size, graph, set=self.settings, reuse=True, window=window)
        self.error = ""
        self.version = 0
        self.progressive = self.playing = self.from_light = False
        self.accumulation: Accumulation | None = None
        self.frame_ms: deque[float] = deque(maxlen=FRAMES_KEPT)
        self.laps: dict[str, tuple[float, float]] = {}
        self.skipped: frozenset[str] = frozenset()
        self.counters: dict[str, int] = {}
        self._noise = Noise()
        self._path: Path | None = None
        self._undo: Callable[[], None] = lambda: None
        self._still = False
        self.drawn: Plan | None = None
        self.use(scene)
        self.plan = self._planned()

    def use(self, scene: Scene) -> None:
        """Show `scene`, from the start of its motions."""
        self.scene, self.time = scene, 0.0
        self._place(scene.at(0.0))
        self.emission = self.spotlight.emission

    def _place(self, scene: Scene) -> None:
        self.geometry = scene.geometry
        self.camera = replace(scene.camera, motion=None)
        self.spotlight = replace(scene.spotlight, motion=None)
        self.moved()

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the picture."""
        return self.renderer.size

    @property
    def eye(self) -> Camera:
        """Where the picture is seen from: the camera, or the light."""
        return as_camera(self.spotlight) if self.from_light else self.camera

    @property
    def shown(self) -> Scene:
        """The scene as it is drawn."""
        return replace(self.scene, geometry=self.geometry, camera=self.eye, spotlight=self.spotlight)

    def moved(self) -> None:
        """Camera, light, scene or seed have changed: the picture must be drawn again."""
        self._still = False

    def look(self, camera: Camera) -> None:
        """See the scene from `camera`."""
        self.camera = camera
        self.moved()

    def shine(self, light: Spotlight) -> None:
        """Light the scene by `light`."""
        self.spotlight = light
        self.moved()

    def open(self, name: str) -> None:
        """Load another scene, as `deferred-ir view NAME` would: its [render] table counts. The old one stays if not."""
        before = self.scene
        try:
            scene = load(name)
            self.scene = scene
            graph = scene.render.graph or self.graph
            self._configure(graph, choose_settings(graph, scene.render, {}, None))
        except Error as error:
            self.scene, self.error = before, str(error)
            return
        self.use(scene)

    def change(self, graph: str | None = None, settings: Mapping[str, Any] | None = None) -> None:
        """Take another graph, or other settings, and read the graph's files again; the old ones stay if they fail."""
        try:
            self._configure(
                self.graph if graph is None else graph, dict(self.settings if settings is None else settings)
            )
        except Error as error:
            self.error = str(error)

    def _configure(self, graph: str, settings: dict[str, Any]) -> None:
        before = self.graph, self.settings, self.plan
        undo = self.renderer.configure(graph=graph, set=settings)

        def back() -> None:
            undo()
            self.graph, self.settings, self.plan = before

        try:
            self.plan = self._planned()
        except Error:
            undo()
            raise
        self.graph, self.settings, self.error, self._undo = graph, settings, "", back

    def choose(self, graph: str) -> None:
        """Take another graph, with those of the settings that it knows."""
        self.change(graph, {})

    def adjust(self, key: str, value: Any) -> None:
        """One parameter, "pass.param"."""
        self.change(settings={**self.settings, key: value})

    def resize(self, size: tuple[int, int]) -> None:
        """Another size of the picture, at least a pixel."""
        if size != self.size:
            self.renderer.configure(size=size)
            self.plan = self._planned()
            self.moved()

    def reload_shaders(self) -> None:
        """Build the programs again whose files have changed; the last good ones stay where that fails."""
        try:
            changed = self.renderer.executor.reload()
        except Error as error:
            self.error = str(error)
            return
        self.error = ""
        if changed:
            self.moved()

    def _planned(self) -> Plan:
        graph = self.renderer.graph()
        missing = [name for name in ("display", "radiance") if name not in graph.outputs]
        if missing:
            raise GraphError(
                f"{graph.origin}: has no output '{missing[0]}', which a picture needs; add it to [outputs]"
            )
        return self.renderer.plan(self.scene_facts, outputs=[name for name in graph.outputs if name in IMAGES])

    @property
    def scene_facts(self) -> Scene:
        """The scene whose facts count for the plan: with the light as it is now."""
        light = self.__dict__.get("spotlight", self.scene.spotlight)
        return replace(self.scene, spotlight=light)

    def draw(self) -> bool:
        """Bring the picture up to date; whether there was anything to do."""
        if self.playing:
            self.time += 1 / FRAMES_PER_SECOND
            self._place(self.scene.at(self.time))
        if self._path:
            self._path.add(clock.monotonic(), self.camera, self.spotlight)
        try:
            changed = self._draw()
            self.version += changed
            return changed
        except Error as error:
            self.error = str(error)
            self._undo()
            self._undo, self.drawn, self.accumulation = lambda: None, None, None
            self._still = False
            return False

    def _draw(self) -> bool:
        self.plan, before = self._planned(), self.drawn
        if self._still and self.plan is before:
            return self._accumulate()
        if self.accumulation and self._still and before and self._only_late(before):
            self.accumulation.follow(self.plan)
            self.accumulation.show()
            ran = True
        else:
            self.accumulation = None
            ran = self._frame()
        # What passes keep from frame to frame may take some to come to rest (graph `incremental`).
        self.drawn, self._still, self._undo = self.plan, self.accumulation is not None or not ran, lambda: None
        return ran

    def _only_late(self, before: Plan) -> bool:
        """Whether only what is made of the mean differs from the plan `before`."""
        return changed(before, self.plan) <= readers(self.plan, self.plan.outputs["radiance"])

    def _frame(self) -> bool:
        """Draw a frame; whether any pass had to run."""
        measurement = Measurement()
        self.renderer.draw(self.shown, self.plan, seed=self.seed, measurement=measurement)
        self.renderer.finish(measurement)
        skipped = frozenset(self.renderer.executor.skipped)
        if len(skipped) == len(self.plan.steps):
            return False
        self.skipped = skipped
        self._keep(measurement)
        return True

    def _accumulate(self) -> bool:
        """Nothing moves: add a frame to the mean."""
        if not self.progressive:
            return False
        if self.accumulation is None:
            self.accumulation = Accumulation(self.renderer, self.shown, self.plan, seed=self.seed)
        self.accumulation.draw()
        self._noise.add(self.accumulation)
        self.accumulation.show()
        return True

    @property
    def noise_text(self) -> str:
        """What is known of the mean's error, for the status line."""
        noise = self._noise.of(self.accumulation) if self.accumulation else None
        return "" if noise is None else f", relMSE by noise about {noise:.2g}"

    def _keep(self, measurement: Measurement) -> None:
        self.frame_ms += measurement.frame_ms
        for laps in measurement.laps:
            self.laps |= laps
        for counters in measurement.counters:
            self.counters |= counters

    def output(self, source: tuple[str, str]) -> Any:
        """The resource that (pass, port) wrote last, None where it has not run yet."""
        try:
            return self.renderer.executor.resource(source)
        except KeyError:
            return None

    def image(self) -> Image:
        """The picture on screen."""
        return self.renderer.read(self.plan)

    def exposure(self) -> float | None:
        """Stops of the picture on screen where its exposure is automatic, else None."""
        plan = self.plan
        return automatic_stops(self.image().radiance) if exposed(plan, 0.0) is not plan else None

    def toned(self, radiance: Any, stops: float | None) -> np.ndarray:
        """Display pixels of `radiance` (H, W, 3) by this graph, uint8 (H, W, 4), bottom row first.

        stops: in place of an automatic exposure, so that two images are shown alike.
        """
        place, late = self.plan.outputs["radiance"], readers(self.plan, self.plan.outputs["radiance"])
        plan = self.plan if stops is None else exposed(self.plan, stops)
        texture = self.output(place)
        pixels = np.ones((*radiance.shape[:2], 4), np.float32)
        pixels[..., :3] = radiance[::-1]
        with self.renderer.gpu.ctx:
            before = texture.read()
            try:
                texture.upload(pixels)
                self.renderer.draw(self.shown, plan, seed=self.seed, steps=late)
                display: np.ndarray = self.output(plan.outputs["display"]).read()
            finally:
                texture.upload(before)
                self.renderer.draw(self.shown, self.plan, seed=self.seed, steps=late)
        return display

    @property
    def bounces(self) -> int:
        """Bounces of indirect light that the graph makes."""
        return max(find_parameters(self.renderer.graph(), "bounces").values(), default=1)

    def choose_motions(self) -> tuple[Camera, Spotlight]:
        """Return eye and light as a scene file should have them: with their motions if they are where those begin."""
        start = self.scene.at(0.0)
        camera, light = self.eye, self.spotlight
        if camera == replace(start.camera, motion=None):
            camera = self.scene.camera
        if light == replace(start.spotlight, motion=None):
            light = self.scene.spotlight
        return camera, light

    @property
    def recording(self) -> bool:
        """Whether the way of camera and light is being recorded."""
        return self._path is not None

    def record(self, on: bool) -> None:
        """Record it, or end that: then it is the scene's motion, which can be played and saved."""
        if on and not self._path:
            self._path = Path()
        elif not on and self._path:
            scene, self._path = self._path.applied(self.scene), None
            emission = self.emission
            self.use(scene)
            self.emission = emission

    def close(self) -> None:
        """Give back what is on the device."""
        self.renderer.close()
