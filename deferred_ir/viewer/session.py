"""What the viewer shows: a scene, its camera and lights, a graph with settings, and the Renderer that draws them.

Knows neither window nor controls. A change costs no more than it must: frames are reused (deferred_ir/engine/reuse.py),
so a pass is skipped while its inputs are unchanged. Whatever fails leaves the last good picture, and `error`.
"""

from __future__ import annotations

import time as clock
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from deferred_ir.base.errors import Error, GraphError
from deferred_ir.engine.accumulation import Accumulation, find_readers
from deferred_ir.engine.measurement import Measurement
from deferred_ir.engine.renderer import Renderer
from deferred_ir.engine.settings import DEFAULT_GRAPH, choose_settings
from deferred_ir.engine.setup import IMAGES
from deferred_ir.gl.devices import Loader
from deferred_ir.graph.graph import Plan
from deferred_ir.loading.load import load
from deferred_ir.output.image import Image
from deferred_ir.scene.camera import Camera
from deferred_ir.scene.lights.base import Light
from deferred_ir.scene.motion import FRAMES_PER_SECOND
from deferred_ir.scene.scene import Scene
from deferred_ir.viewer.edits.lights import LightList
from deferred_ir.viewer.edits.materials import MaterialList
from deferred_ir.viewer.edits.recording import Recorder
from deferred_ir.viewer.navigation import as_camera, looks
from deferred_ir.viewer.plan_changes import find_changed

PLOTTED = 240
"""Latest frames whose times are plotted."""


class Session:
    """One scene in one Renderer, on the context of `window`.

    size: (width, height) of the picture. settings: {"pass.param": value}. error: what last went wrong, "" if nothing.
    plan: what is to be drawn; drawn: what was drawn last, None where that failed. version: goes up with each new
    picture. skipped: passes that the last frame did not run. laps: {pass: (GPU, CPU)}, milliseconds of its last run.
    """

    def __init__(
        self,
        scene: Scene,
        size: tuple[int, int],
        window: Loader,
        *,
        graph: str = DEFAULT_GRAPH,
        settings: Mapping[str, Any] | None = None,
        seed: int = 0,
    ) -> None:
        self.graph, self.settings, self.seed = graph, dict(settings or {}), seed
        self.renderer = Renderer(size, graph, set=self.settings, reuse=True, window=window)
        self.error = ""
        self.version = 0
        self.progressive = self.playing = self.from_light = False
        self.accumulation: Accumulation | None = None
        self.frame_ms: deque[float] = deque(maxlen=PLOTTED)
        self.laps: dict[str, tuple[float, float]] = {}
        self.skipped: frozenset[str] = frozenset()
        self.counters: dict[str, int] = {}
        self._recorder: Recorder | None = None
        self._undo: Callable[[], None] = lambda: None
        self._still = False
        self.drawn: Plan | None = None
        self.lights, self.materials = LightList(self.invalidate), MaterialList(self.invalidate)
        self.use(scene)
        self.plan = self._make_plan(self.shown)

    # The scene, its camera and its lights

    def use(self, scene: Scene) -> None:
        """Show `scene`, from the start of its motions."""
        self.lights.use(scene.lights)
        self.materials.use(scene)
        self.scene, self.time = scene, 0.0
        self._place()

    def _place(self) -> None:
        """Take camera and models from where the scene's motions are."""
        placed = self.scene.at(self.time)
        self.geometry, self.camera = placed.geometry, replace(placed.camera, motion=None)
        self.invalidate()

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the picture."""
        return self.renderer.size

    @property
    def light(self) -> Any:
        """The selected light, None without any."""
        return self.lights.light

    @property
    def sees_from_light(self) -> bool:
        """Whether the view on screen is that of the selected light."""
        return self.from_light and looks(self.light)

    @property
    def eye(self) -> Camera:
        """The view on screen: the camera's, or the light's."""
        return as_camera(self.light, self.camera.fov) if self.sees_from_light else self.camera

    @property
    def shown(self) -> Scene:
        """The scene as it is drawn."""
        surfaces = replace(self.scene, geometry=self.geometry, materials=self.materials.shown)
        return replace(surfaces, camera=self.eye, lights=self.lights.shining)

    def invalidate(self) -> None:
        """Ask for a new picture: camera, lights, scene or seed have changed."""
        self._still = False

    def look(self, camera: Camera) -> None:
        """See the scene from `camera`."""
        self.camera = camera
        self.invalidate()

    def shine(self, light: Light) -> None:
        """Light the scene by `light`, in place of the selected one."""
        self.lights.put(light)

    @property
    def recording(self) -> bool:
        """Whether the paths of camera and lights are being recorded."""
        return self._recorder is not None

    def switch_recording(self, on: bool) -> None:
        """Record the paths of camera and lights; switched off, they become the scene's motion."""
        if on and not self._recorder:
            self._recorder = Recorder()
        elif not on and self._recorder:
            recorder, self._recorder = self._recorder, None
            lights = tuple(recorder.make_light(entry) for entry in self.lights.entries)
            self.scene = replace(self.scene, camera=recorder.make_camera(self.camera), lights=lights)
            self.lights.restart(lights)
            self.time = 0.0
            self._place()

    # The graph and its settings

    def open(self, name: str) -> None:
        """Load another scene as `deferred-ir view NAME` would; the old one stays on failure."""
        try:
            scene = load(name)
            graph = scene.render.graph or self.graph
            self._configure(graph, choose_settings(graph, scene.render, {}, None), scene)
        except Error as error:
            self.error = str(error)
            return
        self.use(scene)

    def change(self, graph: str | None = None, settings: Mapping[str, Any] | None = None) -> None:
        """Take another graph, or other settings, and read the graph's files again; the old ones stay on failure."""
        try:
            self._configure(
                self.graph if graph is None else graph,
                dict(self.settings if settings is None else settings),
                self.shown,
            )
        except Error as error:
            self.error = str(error)

    def _configure(self, graph: str, settings: dict[str, Any], scene: Scene) -> None:
        """Plan with another graph or other settings. Raises Error, and changes nothing then."""
        before = self.graph, self.settings, self.plan, self.renderer.setup

        def restore() -> None:
            self.graph, self.settings, self.plan, self.renderer.setup = before

        self.renderer.configure(graph=graph, set=settings)
        try:
            self.plan = self._make_plan(scene)
        except Error:
            restore()
            raise
        self.graph, self.settings, self.error, self._undo = graph, settings, "", restore

    def choose(self, graph: str) -> None:
        """Take another graph, with its own parameters."""
        self.change(graph, {})

    def adjust(self, key: str, value: Any) -> None:
        """Set one parameter, "pass.param"."""
        self.change(settings={**self.settings, key: value})

    def resize(self, size: tuple[int, int]) -> None:
        """Give the picture another (width, height), at least a pixel."""
        if size != self.size:
            self.renderer.configure(size=size)
            self.plan = self._make_plan(self.shown)
            self.invalidate()

    def reload_shaders(self) -> None:
        """Build the programs again whose files have changed; the last good ones stay on failure."""
        try:
            changed = self.renderer.executor.reload()
        except Error as error:
            self.error = str(error)
            return
        self.error = ""
        if changed:
            self.invalidate()

    def _make_plan(self, scene: Scene) -> Plan:
        """Plan all images of a frame of `scene`. Raises GraphError if the graph makes no picture."""
        graph = self.renderer.graph()
        missing = [name for name in ("display", "radiance") if name not in graph.outputs]
        if missing:
            raise GraphError(
                f"{graph.origin}: has no output '{missing[0]}', which a picture needs; add it to [outputs]"
            )
        return self.renderer.plan(scene, outputs=[name for name in graph.outputs if name in IMAGES])

    # The picture

    def draw(self) -> bool:
        """Bring the picture up to date. Returns whether it changed."""
        try:
            if self.playing:
                self.time += 1 / FRAMES_PER_SECOND
                self._place()
                self.lights.follow(self.time)
            if self._recorder:
                self._recorder.add(clock.monotonic(), self.camera, self.lights.entries)
            changed = self._update()
        except Error as error:
            self.error = str(error)
            self._undo()
            self._undo, self.drawn, self.accumulation = lambda: None, None, None
            self._still = self.playing = False
            return False
        self.version += changed
        return changed

    def _update(self) -> bool:
        """Draw what has changed: nothing, another frame of the mean, what reads the mean, or a new frame."""
        self.plan, before = self._make_plan(self.shown), self.drawn
        if self._still and self.plan is before:
            return self._accumulate()
        readers = find_readers(self.plan, self.plan.outputs["radiance"])  # if only these differ, the mean stays
        if self.accumulation and self._still and before and find_changed(before, self.plan) <= readers:
            self.accumulation.follow(self.plan)
            self.accumulation.show()
            ran = True
        else:
            self.accumulation = None
            ran = self._draw_frame()
        # Passes that carry state from frame to frame may take some frames to come to rest (graph `incremental`).
        self.drawn, self._still, self._undo = self.plan, self.accumulation is not None or not ran, lambda: None
        return ran

    def _draw_frame(self) -> bool:
        """Draw a frame. Returns whether any pass had to run."""
        measurement = Measurement()
        self.renderer.draw(self.shown, self.plan, seed=self.seed, measurement=measurement)
        self.renderer.finish(measurement)
        skipped = frozenset(self.renderer.executor.skipped)
        if len(skipped) == len(self.plan.steps):
            return False
        self.skipped = skipped
        self.frame_ms += measurement.frame_ms
        for laps in measurement.laps:
            self.laps |= laps
        for counters in measurement.counters:
            self.counters |= counters
        return True

    def _accumulate(self) -> bool:
        """Add a frame to the mean where frames are averaged. Returns whether they are."""
        if not self.progressive:
            return False
        mean = self.accumulation or Accumulation(self.renderer, self.shown, self.plan, seed=self.seed)
        mean.draw()
        if not mean.frames & (mean.frames - 1):  # at powers of two: it takes a while
            mean.estimate()
        self.accumulation = mean
        mean.show()
        return True

    def output(self, source: tuple[str, str]) -> Any:
        """Return the resource that (pass, port) wrote last, None where the pass has not run yet."""
        try:
            return self.renderer.executor.resource(source)
        except KeyError:
            return None

    def image(self) -> Image:
        """Read the picture on screen."""
        return self.renderer.read(self.plan)

    def close(self) -> None:
        """Give back what is on the device."""
        self.renderer.close()
