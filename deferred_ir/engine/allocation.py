"""What a plan needs on the GPU: the textures, buffers and framebuffers of its passes, and the passes' state.

Resources are held by (pass, port, description, type of pass) and survive a new plan that still has them, as does the
state of a pass whose resources all survive.
"""

from __future__ import annotations

from collections import Counter
from typing import Any

from deferred_ir.base.errors import DeviceError
from deferred_ir.frame.pass_io import Io, Resource, new_state, single_resources
from deferred_ir.gl.buffers import GpuBuffer
from deferred_ir.gl.context import Gpu
from deferred_ir.gl.framebuffers import Framebuffer
from deferred_ir.gl.shaders import ShaderLibrary
from deferred_ir.gl.textures import GpuTexture
from deferred_ir.graph.aliasing import Source, alias_textures
from deferred_ir.graph.graph import Plan
from deferred_ir.graph.pass_base import Pass
from deferred_ir.graph.ports import Buffer, Description, Texture

Key = tuple[str, str, Description, tuple[int, int] | None, type[Pass]]
"""What tells one resource from another: pass, port, description, frame size where it matters, and pass type."""


class Allocation:
    """Resources and ports of the last plan that was allocated.

    ios: of each step of the plan. aliases: outputs that use another output's texture, whose readers are done by then.
    """

    def __init__(self, gpu: Gpu, library: ShaderLibrary) -> None:
        self.gpu, self._library = gpu, library
        self._resources: dict[Key, Resource] = {}
        self._framebuffers: list[Framebuffer] = []
        self._states: dict[str, tuple[type[Pass], Any]] = {}
        self._made_for: tuple[Plan, tuple[int, int], bool] | None = None
        self.ios: list[Io] = []
        self.aliases: dict[Source, Source] = {}

    def fit(self, plan: Plan, size: tuple[int, int], *, alias: bool) -> None:
        """Allocate what `plan` needs in frames of `size`, unless that is done; what the last plan had, too, stays.

        alias: transient outputs may use each other's textures. Raises DeviceError where there is no room; the next call
        starts over.
        """
        if self._made_for and self._made_for[0] is plan and self._made_for[1:] == (size, alias):
            return
        if self.ios:
            self._states = {io.step.name: (type(io.step.work), io.state) for io in self.ios}
        self.invalidate()
        self.ios = []
        self.aliases = alias_textures(plan) if alias else {}
        for framebuffer in self._framebuffers:
            framebuffer.release()
        self._framebuffers = []
        self.gpu.free_uniforms()
        self._fit_resources(plan, size)
        self.ios = self._connect(plan)
        self._made_for = plan, size, alias

    def invalidate(self) -> None:
        """Have the next call of `fit` connect all ports anew: programs that passes hold are out of date."""
        self._made_for = None

    def _fit_resources(self, plan: Plan, size: tuple[int, int]) -> None:
        """Release what the plan does not have, then allocate what is missing."""
        keys = {
            (step.name, port, output.description, _frame_size(output.description, size), type(step.work))
            for step in plan.steps
            for port, output in step.outputs.items()
            if (step.name, port) not in self.aliases
        }
        for key in self._resources.keys() - keys:
            self._states.pop(key[0], None)
            _release(self._resources.pop(key))
        for key in sorted(keys - self._resources.keys(), key=lambda key: key[:2]):
            self._states.pop(key[0], None)
            try:
                self._resources[key] = _allocate(self.gpu, key[2], size)
            except DeviceError as error:
                raise DeviceError(f"{key[0]}.{key[1]}: {error}") from error

    def _connect(self, plan: Plan) -> list[Io]:
        """Return each step's ports, with the framebuffer of what it draws into and the state that it has so far."""
        ports = {key[:2]: resource for key, resource in self._resources.items()}
        ports |= {source: ports[home] for source, home in self.aliases.items()}
        written = {(s.name, port): output for s in plan.steps for port, output in s.outputs.items()}
        ios = []
        for step in plan.steps:
            inputs = {port: ports[source] if source else None for port, source in step.sources.items()}
            outputs = {port: ports[step.name, port] for port in step.outputs}
            kind, state = self._states.get(step.name, (None, None))
            state = state if kind is type(step.work) else new_state(step.work)
            io = Io(self._library, step, {**inputs, **outputs}, written, state)
            attached = {port: inputs[port] for port, declared in step.work.inputs.items() if declared.attach}
            drawn = {port: outputs[port] for port, output in step.outputs.items() if output.attach}
            targets = {port: r for port, r in {**drawn, **attached}.items() if isinstance(r, GpuTexture)}
            if targets:
                self._framebuffers.append(Framebuffer(self.gpu, targets, step.name))
                io.attach(self._framebuffers[-1])
            ios.append(io)
        return ios

    def resource(self, source: Source) -> Any:
        """Return what (pass, port) wrote in the last frame; KeyError where another pass has written into it since."""
        home = self.aliases.get(source, source)
        found = next((resource for key, resource in self._resources.items() if key[:2] == home), None)
        if found is None:
            raise KeyError(f"{source[0]}.{source[1]} is not in the plan")
        last = next((other for other, of in reversed(self.aliases.items()) if of == home), home)
        if source != last:
            raise KeyError(
                f"{source[0]}.{source[1]}: another pass has its texture by now; make it an output of the graph"
            )
        return found

    def state(self, name: str) -> Any:
        """Return the state (`Pass.State`) of the pass `name`; None if it has none, or is not in the plan."""
        return next((io.state for io in self.ios if io.step.name == name), None)

    def forget(self) -> None:
        """Start all passes over with new states."""
        self._states.clear()
        for io in self.ios:
            io.forget()

    def memory(self) -> dict[str, int]:
        """Return the bytes of all textures and of all buffers."""
        every = [single for resource in self._resources.values() for single in single_resources(resource)]
        return {
            "textures": sum(single.nbytes for single in every if isinstance(single, GpuTexture)),
            "buffers": sum(single.nbytes for single in every if isinstance(single, GpuBuffer)),
        }

    def nbytes(self) -> dict[str, int]:
        """Return the bytes that each output ("pass.port") has to itself, and their sum for each pass."""
        found: Counter[str] = Counter()
        for (name, port, *_), resource in self._resources.items():
            size = sum(single.nbytes for single in single_resources(resource))
            found[f"{name}.{port}"] += size
            found[name] += size
        return dict(found)

    def release(self) -> None:
        """Release all framebuffers and resources."""
        for framebuffer in self._framebuffers:
            framebuffer.release()
        for resource in self._resources.values():
            _release(resource)


def _frame_size(description: Description, size: tuple[int, int]) -> tuple[int, int] | None:
    """The frame's size where the resource depends on it."""
    return size if isinstance(description, Texture) and description.size is None else None


def _allocate(gpu: Gpu, description: Description, size: tuple[int, int]) -> Resource:
    """Allocate one output. Raises DeviceError for what the driver does not take, with what to use instead."""
    if isinstance(description, Buffer):
        return GpuBuffer(gpu, description)
    if description.layers > gpu.max_layers:
        raise DeviceError(
            f"{description.layers} layers, and this driver takes {gpu.max_layers}; use fewer VPLs or smaller maps"
        )
    width_height = description.size or size
    if max(width_height) > gpu.max_size:
        raise DeviceError(
            f"{width_height[0]}x{width_height[1]} pixels, and this driver draws at most {gpu.max_size}; "
            f"use {description.mend}"
        )
    if not description.copies:
        return GpuTexture(gpu, description, width_height)
    copies: list[GpuTexture] = []
    try:
        for number in range(description.copies):
            own = (description.edges[number],) * 2 if description.edges else width_height
            copies.append(GpuTexture(gpu, description, own))
    except DeviceError:
        _release(copies)  # the user is told to ask for less: room for that must be left
        raise
    return copies


def _release(resource: Resource) -> None:
    for single in single_resources(resource):
        single.release()
