"""Runs plans: executes the passes in order, skips those whose outputs would come out the same, and times the rest."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Container, Mapping
from typing import Any

from deferred_ir.engine.allocation import Allocation
from deferred_ir.engine.reuse import Runs
from deferred_ir.frame.frame import FRAME, Frame
from deferred_ir.frame.pass_io import Io, single_resources
from deferred_ir.gl.context import Gpu
from deferred_ir.gl.shaders import ShaderLibrary
from deferred_ir.gl.textures import GpuTexture
from deferred_ir.gl.timers import Timers
from deferred_ir.graph.aliasing import Source
from deferred_ir.graph.graph import Plan, Step

FRAME_BLOCK = 0


class Executor:
    """Owns what plans need on the GPU, and runs them.

    find_computed: returns the modules of the passes that run in compute shaders unless they are told otherwise.
    counters: what the passes published in the last frame. skipped: names of the passes that did not run in it.
    """

    def __init__(self, gpu: Gpu, find_computed: Callable[[], Collection[str]] = frozenset) -> None:
        self.gpu, self._find_computed = gpu, find_computed
        self.library = ShaderLibrary(gpu)
        self.allocation = Allocation(gpu, self.library)
        self.counters: Counter[str] = Counter()
        self.skipped: tuple[str, ...] = ()
        self._frame_block = gpu.ctx.buffer(reserve=FRAME.itemsize, dynamic=True)
        self._runs = Runs()

    def run(
        self, plan: Plan, frame: Frame, timers: Timers | None = None, *, steps: Container[str] | None = None
    ) -> None:
        """Draw one frame, or of its passes only those named in `steps`; timers get a lap for each that runs.

        If frame.reuse, a pass is skipped while its outputs hold what it would write.
        """
        self.allocation.fit(plan, frame.size, alias=not (frame.reuse or frame.keep_all))
        self.counters.clear()
        skipped: list[str] = []
        self._frame_block.write(frame.pack())
        self._frame_block.bind_to_uniform_block(FRAME_BLOCK)
        frame.buffers.bind()
        for step, io in zip(plan.steps, self.allocation.ios, strict=True):
            if steps is not None and step.name not in steps:
                continue
            figures = self._runs.figures(step, io, frame) if frame.reuse else None
            if figures is None:
                self._execute(step, io, frame, timers)
            else:
                self.counters.update(figures)
                skipped.append(step.name)
        self.skipped = tuple(skipped)

    def _execute(self, step: Step, io: Io, frame: Frame, timers: Timers | None) -> None:
        """Run one pass."""
        self._runs.forget(step)
        self.gpu.reset()
        io.begin(self._find_computed)
        if timers:
            timers.mark(step.name)
        step.work.execute(frame, io)
        io.end()
        self.gpu.check(step.name)
        for port in step.outputs:
            for single in single_resources(io[port]):
                if isinstance(single, GpuTexture):  # a buffer knows what was written into it
                    single.touch()
        if frame.reuse:
            self._runs.remember(step, io, frame)
        for published in (io.counters, io.figures):
            for name, value in published.items():
                self.counters[name] += value

    def resource(self, source: Source) -> Any:
        """Return what (pass, port) wrote in the last frame; KeyError where another pass has written into it since."""
        return self.allocation.resource(source)

    def state(self, name: str) -> Any:
        """Return the state (`Pass.State`) of the pass `name`; None if it has none, or is not in the plan."""
        return self.allocation.state(name)

    def stages(self) -> Mapping[str, str]:
        """Return "fragment" or "compute" for each pass of the last frame's plan that can run in both and has run."""
        return {io.step.name: io.stage for io in self.allocation.ios if io.stage}

    def forget(self) -> None:
        """Drop the states of all passes; the next frame runs each of them afresh."""
        self._runs.clear()
        self.allocation.forget()

    def reload(self) -> bool:
        """Read the shader files again. Returns whether one has changed; after a ShaderError the old programs go on."""
        with self.gpu.ctx:
            changed = self.library.reload()
        if changed:
            self.allocation.invalidate()
            self._runs.clear()
        return changed

    def memory(self) -> dict[str, int]:
        """Return the bytes of this executor's textures and buffers."""
        memory = self.allocation.memory()
        memory["buffers"] += self._frame_block.size + self.gpu.nbytes
        return memory

    def release(self) -> None:
        """Release all that the executor owns."""
        self.allocation.release()
        self._frame_block.release()
        self.library.release()
