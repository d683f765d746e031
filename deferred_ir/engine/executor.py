"""Runs plans: allocates what `planning.compile` planned, binds each pass's ports by name, and times the passes.

Resources are held by (pass, port, description, type of pass) and survive a new plan that still has them, as does the
state of a pass whose resources all survive. Programs are held by source and defines.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Container
from typing import Any, Protocol

from deferred_ir.base.errors import DeviceError
from deferred_ir.engine.reuse import Runs
from deferred_ir.frame.frame import FRAME, Frame
from deferred_ir.frame.pass_io import Io, Resource, new_state
from deferred_ir.gl.buffers import GpuBuffer
from deferred_ir.gl.context import Gpu
from deferred_ir.gl.framebuffers import Framebuffer
from deferred_ir.gl.shaders import ShaderLibrary
from deferred_ir.gl.textures import GpuTexture
from deferred_ir.gl.timers import Timers
from deferred_ir.graph.aliasing import alias_textures
from deferred_ir.graph.graph import Plan, Step
from deferred_ir.graph.pass_base import Pass
from deferred_ir.graph.ports import Buffer, Description, Texture

FRAME_BLOCK = 0


class Watch(Protocol):
    """Who looks at each pass's ports before and after it runs."""

    def begin(self, step: Step, io: Io) -> None:
        """Before."""

    def end(self, step: Step, io: Io) -> None:
        """After."""


Key = tuple[str, str, Description, tuple[int, int] | None, type[Pass]]
"""Of a resource: pass, port, what it is, and the type of the pass, whose state describes what it holds."""


class Executor:
    """Owns what a plan needs on the GPU. `counters` holds what the passes published in the last frame.

    tenants: outputs that have the texture of another one, whose readers are done by then.
    """

    def __init__(self, gpu: Gpu) -> None:
        self.gpu = gpu
        self.library = ShaderLibrary(gpu)
        self.counters: Counter[str] = Counter()
        self._frame_block = gpu.ctx.buffer(reserve=FRAME.itemsize, dynamic=True)
        self._resources: dict[Key, Resource] = {}
        self._framebuffers: list[Framebuffer] = []
        self._plan: Plan | None = None
        self._size, self._shares = (0, 0), False
        self.tenants: dict[tuple[str, str], tuple[str, str]] = {}
        self._ios: list[Io] = []
        self._states: dict[str, tuple[type[Pass], Any]] = {}
        self._runs = Runs()
        self.kept: tuple[str, ...] = ()
        self.watch: Watch | None = None

    def run(
        self, plan: Plan, frame: Frame, timers: Timers | None = None, *, steps: Container[str] | None = None
    ) -> None:
        """Draw one frame, or of its passes only those named in `steps`; timers get a lap for each that runs.

        `kept` names those that did not run since they would have written what they wrote last, if frame.reuse.
        """
        shares = not (frame.reuse or frame.keep_all)
        if plan is not self._plan or frame.size != self._size or shares != self._shares:
            self._allocate(plan, frame.size, shares)
        self.counters.clear()
        kept: list[str] = []
        self._frame_block.write(frame.block())
        self._frame_block.bind_to_uniform_block(FRAME_BLOCK)
        frame.buffers.bind()
        for step, io in zip(plan.steps, self._ios, strict=True):
            if steps is not None and step.name not in steps:
                continue
            figures = self._runs.figures(step, io, frame) if frame.reuse else None
            if figures is not None:
                self.counters.update(figures)
                kept.append(step.name)
                continue
            self._runs.forget(step)
            if self.watch:
                self.watch.begin(step, io)
            self.gpu.reset()
            io.begin()
            if timers:
                timers.mark(step.name)
            step.work.execute(frame, io)
            self.gpu.check(step.name)
            if self.watch:
                self.watch.end(step, io)
            for port in step.outputs:
                _touch(io[port])
            self._runs.remember(step, io, frame)
            self.counters.update(io.counters)
            self.counters.update(io.figures)
        self.kept = tuple(kept)

    def resource(self, source: tuple[str, str]) -> Any:
        """What (pass, port) wrote in the last frame; KeyError where another pass has written into it since."""
        home = self.tenants.get(source, source)
        found = next((r for key, r in self._resources.items() if key[:2] == home), None)
        if found is None:
            raise KeyError(f"{source[0]}.{source[1]} is not in the plan")
        if source != self._last_tenant(home):
            raise KeyError(
                f"{source[0]}.{source[1]}: another pass has its texture by now; make it an output of the graph"
            )
        return found

    def _last_tenant(self, home: tuple[str, str]) -> tuple[str, str]:
        """Whose the texture of `home` is at the end of a frame."""
        return next((source for source, of in reversed(self.tenants.items()) if of == home), home)

    def state(self, name: str) -> Any:
        """Return the state (`Pass.State`) of the pass `name`; None if it has none, or no frame has run it yet."""
        return next((io.state for io in self._ios if io.step.name == name), None)

    def forget(self) -> None:
        """Drop the states of all passes; the next frame runs each of them afresh."""
        self._runs.clear()
        self._states.clear()
        for io in self._ios:
            io.forget()

    def reload(self) -> bool:
        """Read the shader files again; whether one has changed. After a ShaderError the old programs go on."""
        with self.gpu.ctx:
            changed = self.library.reload()
        if changed:
            self._plan = None  # passes hold the programs that they have used
            self._runs.clear()
        return changed

    def memory(self) -> dict[str, int]:
        """Bytes of this executor's textures and buffers."""
        textures = sum(r.nbytes for r in self._all() if isinstance(r, GpuTexture))
        buffers = sum(r.nbytes for r in self._all() if isinstance(r, GpuBuffer))
        return {"textures": textures, "buffers": buffers + self._frame_block.size + self.gpu.nbytes}

    def nbytes(self) -> dict[str, int]:
        """Bytes of the textures and buffers that each output of the last plan has to itself, and of each pass."""
        found: Counter[str] = Counter()
        for (name, port, *_), resource in self._resources.items():
            size = sum(single.nbytes for single in (resource if isinstance(resource, list) else [resource]))
            found[f"{name}.{port}"] += size
            found[name] += size
        return dict(found)

    def _all(self) -> list[GpuTexture | GpuBuffer]:
        return [single for r in self._resources.values() for single in (r if isinstance(r, list) else [r])]

    def _allocate(self, plan: Plan, size: tuple[int, int], shares: bool) -> None:
        """Make the plan's resources and framebuffers; what the last plan had and this one has stays.

        shares: transient outputs have textures in common.
        """
        if self._ios:
            self._states = {io.step.name: (type(io.step.work), io.state) for io in self._ios}
        self._plan = None  # if an allocation fails, the next frame starts over
        self.tenants = alias_textures(plan) if shares else {}
        keys = {
            (step.name, port, output.description, _size(output.description, size), type(step.work))
            for step in plan.steps
            for port, output in step.outputs.items()
            if (step.name, port) not in self.tenants
        }
        for framebuffer in self._framebuffers:
            framebuffer.release()
        self._framebuffers, self._ios = [], []
        self.gpu.free_uniforms()
        for key in [key for key in self._resources if key not in keys]:
            self._states.pop(key[0], None)
            _release(self._resources.pop(key))
        for key in sorted(keys - self._resources.keys(), key=lambda key: key[:2]):
            self._states.pop(key[0], None)
            try:
                self._resources[key] = self._make(key[2], size)
            except DeviceError as error:
                raise DeviceError(f"{key[0]}.{key[1]}: {error}") from error
        ports = {key[:2]: resource for key, resource in self._resources.items()}
        ports |= {source: ports[home] for source, home in self.tenants.items()}
        written = {(s.name, port): output for s in plan.steps for port, output in s.outputs.items()}
        ios = []
        for step in plan.steps:
            inputs = {port: ports[source] if source else None for port, source in step.sources.items()}
            outputs = {port: ports[step.name, port] for port in step.outputs}
            kind, state = self._states.get(step.name, (None, None))
            state = state if kind is type(step.work) else new_state(step.work)
            io = Io(self.library, step, {**inputs, **outputs}, written, state)
            attached = {port: inputs[port] for port, declared in step.work.inputs.items() if declared.attach}
            drawn = {port: ports[step.name, port] for port, output in step.outputs.items() if output.attach}
            targets = {port: r for port, r in {**drawn, **attached}.items() if isinstance(r, GpuTexture)}
            if targets:
                self._framebuffers.append(Framebuffer(self.gpu, targets, step.name))
                io.attach(self._framebuffers[-1])
            ios.append(io)
        self._ios = ios
        self._plan, self._size, self._shares = plan, size, shares

    def _make(self, description: Description, size: tuple[int, int]) -> Resource:
        if isinstance(description, Buffer):
            return GpuBuffer(self.gpu, description)
        if description.layers > self.gpu.max_layers:
            raise DeviceError(
                f"{description.layers} layers, and this driver takes {self.gpu.max_layers}; "
                "use fewer VPLs or smaller maps"
            )
        width_height = description.size or size
        if max(width_height) > self.gpu.max_size:
            raise DeviceError(
                f"{width_height[0]}x{width_height[1]} pixels, and this driver draws at most {self.gpu.max_size}; "
                f"use {description.mend}"
            )
        if description.copies:
            made: list[GpuTexture] = []
            try:
                for _ in range(description.copies):
                    made.append(GpuTexture(self.gpu, description, width_height))
            except DeviceError:
                _release(made)  # the user is told to ask for less: room for that must be left
                raise
            return made
        return GpuTexture(self.gpu, description, width_height)

    def release(self) -> None:
        """Give everything back."""
        for framebuffer in self._framebuffers:
            framebuffer.release()
        for resource in self._resources.values():
            _release(resource)
        self._frame_block.release()
        self.library.release()


def _size(description: Description, frame: tuple[int, int]) -> tuple[int, int] | None:
    """The frame's size where the resource depends on it."""
    return frame if isinstance(description, Texture) and description.size is None else None


def _touch(resource: Resource) -> None:
    """A pass has drawn into it. What it wrote into a buffer the buffer knows."""
    for single in resource if isinstance(resource, list) else [resource]:
        if isinstance(single, GpuTexture):
            single.touch()


def _release(resource: Resource) -> None:
    for single in resource if isinstance(resource, list) else [resource]:
        single.release()
