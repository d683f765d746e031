"""The entry point of the library: a Renderer holds one OpenGL context, one graph and the last scene it drew."""

from __future__ import annotations

import time as clock
from collections.abc import Container, Mapping, Sequence
from contextlib import nullcontext
from functools import cache
from numbers import Integral
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from deferred_ir.base.errors import SettingError
from deferred_ir.engine.executor import Executor
from deferred_ir.engine.goals import Goals
from deferred_ir.engine.measurement import Measurement
from deferred_ir.engine.settings import DEFAULT_GRAPH
from deferred_ir.engine.setup import IMAGES, Setup, check_images
from deferred_ir.frame.facts import collect_facts
from deferred_ir.frame.frame import PARTS, Frame
from deferred_ir.frame.uploads.scene_buffers import SceneBuffers
from deferred_ir.gl.context import Gpu
from deferred_ir.gl.devices import Loader
from deferred_ir.gl.timers import Timers
from deferred_ir.graph.compile import compile
from deferred_ir.graph.graph import Graph, Plan
from deferred_ir.graph.pass_base import Pass
from deferred_ir.output.image import Image
from deferred_ir.rays.tracer import Tracer
from deferred_ir.scene.recentre import recentre
from deferred_ir.scene.scene import Scene
from deferred_ir.tuning.cache import name_machine
from deferred_ir.tuning.stage_costs import list_computed


class Renderer:
    """Renders scenes through a render graph.

    size: (width, height) in pixels. graph: a built-in name or a graph file; None: `deferred`, or `resampled` for a
    given error or time. device: see `deferred-ir devices`.
    set: parameters of passes, {"pass.param": value}. passes: pass classes of your own, {type name: class}, which a
    graph file then names. reuse: a pass is skipped while its inputs are unchanged; else every
    frame redoes everything. keep_all: leave nothing out that this scene or view does not need; the pixels are the same.
    window: its context, which is current, instead of a headless one on `device`.

    One context, one scene upload: render as often as you like, and close it (or use `with`). It belongs to the thread
    that made it.
    """

    def __init__(
        self,
        size: tuple[int, int] = (512, 512),
        graph: str | Path | None = None,
        device: str = "auto",
        *,
        set: Mapping[str, Any] | None = None,
        passes: Mapping[str, type[Pass]] | None = None,
        reuse: bool = False,
        keep_all: bool = False,
        window: Loader | None = None,
    ) -> None:
        if not isinstance(size, Sequence) or len(size) != 2 or not all(isinstance(n, Integral) and n > 0 for n in size):
            raise SettingError(f"size {size!r}: wants two whole numbers above 0, width and height")
        self.reuse, self._keep_all = reuse, keep_all
        self._goals = Goals(self, named=graph is not None)
        name = DEFAULT_GRAPH if graph is None else graph
        self.setup = Setup((int(size[0]), int(size[1])), name, dict(set or {}), dict(passes or {}))
        self.graph()  # a fault in the graph shows before a context is made
        self.gpu = Gpu(device, window)
        if max(size) > self.gpu.max_size:
            self.gpu.close()
            raise SettingError(f"size {size[0]}x{size[1]}: this driver draws at most {self.gpu.max_size} a side")
        self.executor = Executor(self.gpu, cache(self._find_computed))
        self._timers = Timers(self.gpu)
        self._buffers: SceneBuffers | None = None
        self._tracer: Tracer | None = None
        self._scene: Scene | None = None
        self._closed = False

    def configure(
        self,
        *,
        size: tuple[int, int] | None = None,
        graph: str | Path | None = None,
        set: Mapping[str, Any] | None = None,
    ) -> None:
        """Change what is named; the rest stays, and so do programs, textures and the scene that are still needed.

        With `graph` or `set` files are read again. After a GraphError nothing has changed. To take a change back,
        assign the `setup` of before.
        """
        setup = self.setup if graph is None and set is None else self.setup.reload(graph, set)
        self.setup = setup if size is None else setup.resize(size)

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the image in pixels."""
        return self.setup.size

    def graph(self, vpls: int | None = None) -> Graph:
        """Return the graph with this number of VPLs, None for its own."""
        return self.setup.graph(vpls)

    def plan(
        self,
        scene: Scene,
        vpls: int | None = None,
        outputs: Sequence[str] | None = None,
        *,
        keep_all: bool | None = None,
    ) -> Plan:
        """Return what a frame of `scene` runs to write `outputs`, all that the graph has unless some are named.

        keep_all: whether to run what the scene does not need; None: as the Renderer was made.
        """
        if not isinstance(scene, Scene):
            raise SettingError(f"scene: is {type(scene).__name__}, not a Scene; load it first: deferred_ir.load(...)")
        graph = self.graph(vpls)
        facts = collect_facts(scene, self.size, software=self.gpu.device.kind == "software")
        keep_all = self._keep_all if keep_all is None else keep_all
        wanted = tuple(graph.outputs if outputs is None else outputs)
        key = (vpls, facts, keep_all, wanted)
        if key not in self.setup.plans:
            plan = compile(graph, wanted, facts, keep_all=keep_all, parts=PARTS)
            check_images(graph, plan)
            self.setup.plans[key] = plan
        return self.setup.plans[key]

    def render(
        self,
        scene: Scene,
        *,
        vpls: int | None = None,
        seed: int = 0,
        time: float = 0.0,
        accumulate: int | None = None,
        error: float | None = None,
        within: float | None = None,
    ) -> Image:
        """Render one image of `scene` at `time` seconds with `vpls` VPLs (None: as many as the graph says).

        accumulate: frames with fresh samples that are averaged in it; `Accumulation` adds them up one by one. error:
        add frames until their estimate of the image's relMSE is at most this; `accumulate` is then the most frames
        (None: 1024), and `error_estimate` of the image says how far it came. within: seconds that the image may take
        once the renderer runs; what is not given is chosen so, by frames that are measured before the first such image.
        """
        return self._goals.render(
            scene, vpls=vpls, seed=seed, time=time, accumulate=accumulate, error=error, within=within
        )

    def draw(
        self,
        scene: Scene,
        plan: Plan,
        *,
        seed: int = 0,
        time: float = 0.0,
        measurement: Measurement | None = None,
        steps: Container[str] | None = None,
    ) -> None:
        """Draw one frame, wait for it and add its times to `measurement`. steps: names of steps to run, None: all."""
        if not isinstance(seed, Integral) or seed < 0:
            raise SettingError(f"seed {seed!r}: wants a whole number of 0 or more")
        if self._closed:
            raise SettingError("Renderer: is closed; make a new one")
        with self.gpu.ctx:
            start = clock.perf_counter()
            placed = recentre(scene.at(time))
            moved = clock.perf_counter()
            self._upload(placed)
            assert self._buffers
            start += clock.perf_counter() - moved  # once a scene: not what a frame costs
            self._buffers.move(placed.geometry)
            frame = Frame(self.size, placed, self._buffers, self.tracer, seed, time, self.reuse, self._keep_all)
            timers = self._timers if measurement else None
            with timers.frame() if timers else nullcontext():
                self.executor.run(plan, frame, timers, steps=steps)
            self.gpu.ctx.finish()
            self.gpu.gl.check(f"a frame of {self.size[0]}x{self.size[1]}")
            if measurement and timers:
                measurement.frame_ms.append((clock.perf_counter() - start) * 1e3)
                measurement.laps += timers.collect()
                measurement.counters.append(dict(self.executor.counters))
                measurement.skipped.append(self.executor.skipped)

    def reset(self) -> None:
        """Forget all state between frames: the next frame starts afresh and runs every pass."""
        self.executor.forget()

    def finish(self, measurement: Measurement) -> None:
        """Add the timestamps still in flight to `measurement`."""
        with self.gpu.ctx:
            measurement.laps += self._timers.collect(wait=True)

    def read(self, plan: Plan) -> Image:
        """Read the image that the last `draw` of `plan` made."""
        arrays = {name: self.read_texture(s)[::-1] for name, s in plan.outputs.items() if name in IMAGES}
        radiance, display = arrays.get("radiance"), arrays.get("display")
        return Image(
            None if radiance is None else np.ascontiguousarray(radiance[..., :3]),
            None if display is None else np.ascontiguousarray(display[..., :3]),
        )

    def read_texture(self, source: tuple[str, str]) -> Any:
        """Return what the output `source`, (pass, port), holds: an array (H, W, channels), bottom row first."""
        with self.gpu.ctx:
            return self.executor.resource(source).read()

    def write_texture(self, source: tuple[str, str], pixels: Any) -> None:
        """Write `pixels` (H, W, channels), bottom row first, into the output `source`, (pass, port)."""
        with self.gpu.ctx:
            self.executor.resource(source).upload(pixels)

    def memory(self) -> dict[str, int]:
        """Return the bytes of textures and buffers on the device, the scene's included."""
        memory = self.executor.memory()
        if self._buffers:
            memory["textures"] += self._buffers.texture_bytes
            memory["buffers"] += self._buffers.buffer_bytes
        return memory

    def _find_computed(self) -> frozenset[str]:
        """Find the passes that were measured to run faster in compute shaders here, with the same pixels."""
        return list_computed(name_machine(self.gpu.device.name, self.gpu.driver))

    @property
    def embree_seconds(self) -> float:
        """Seconds spent inside Embree since the scene was loaded."""
        return self._tracer.seconds if self._tracer else 0.0

    def _upload(self, scene: Scene) -> None:
        """Upload the scene unless it is on the device; the same surfaces may come with a new camera or light.

        Moving models may be elsewhere, too: then the surfaces are those of one `rest`.
        """
        if not (self._scene and _same_surfaces(scene, self._scene)):
            self._forget()
            self.reset()
            self._buffers = SceneBuffers(self.gpu, scene, general=self._keep_all)
        self._scene = scene

    def tracer(self) -> Tracer:
        """Return Embree over the scene drawn last, in the coordinates of `recentre`, built when first asked for."""
        assert self._scene, "no scene was drawn yet"
        if self._tracer is None:
            self._tracer = Tracer(self._scene)
        self._tracer.follow(self._scene)
        return self._tracer

    def _forget(self) -> None:
        if self._buffers:
            for owner in self._buffers.owners:
                self.executor.library.forget(owner)
            self._buffers.release()
        self._buffers = self._tracer = self._scene = None

    def close(self) -> None:
        """Release the context and all in it; a second call does nothing."""
        if self._closed:
            return
        self._closed = True
        with self.gpu.ctx:
            self._forget()
            self._timers.release()
            self.executor.release()
        self.gpu.close()

    def __enter__(self) -> Renderer:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def _same_surfaces(one: Scene, other: Scene) -> bool:
    same_rest = one.geometry.rest is other.geometry.rest
    return same_rest and one.materials is other.materials and one.textures is other.textures
