"""What a pass works with while it executes: the resources of its ports, its programs, its state, and its counters."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from typing import Any, TypeVar

from deferred_ir.base.errors import DeviceError, ShaderError
from deferred_ir.gl.buffers import GpuBuffer
from deferred_ir.gl.framebuffers import Framebuffer
from deferred_ir.gl.shaders import Define, Program, ShaderLibrary
from deferred_ir.gl.textures import GpuTexture
from deferred_ir.graph.graph import Step
from deferred_ir.graph.pass_base import Pass
from deferred_ir.graph.ports import Output
from deferred_ir.graph.stages import SUFFIXES, find_stage
from deferred_ir.scene.surfaces.materials import SLOTS

NO_DEFINES: Mapping[str, Define] = {}
Resource = GpuTexture | GpuBuffer | list[GpuTexture]
Meta = TypeVar("Meta")
Rectangle = tuple[int, int, int, int]
SCENE_SAMPLERS = {f"{slot}_texture" for slot in SLOTS}
"""Samplers that SceneBuffers binds; all others must be ports."""


class Io:
    """A pass's ports while it executes: `io["depth"]` is a resource, `io.program(...)` knows the ports' defines.

    written: each (pass, port) of the plan as its writer declares it. state: the pass's `State`, which it changes as it
    likes and finds again in the next frame. stage: "fragment" or "compute" for a pass that can run in both, else None;
    its images are bound in the latter. A run publishes counters of its work, figures of what its outputs hold, and
    `again`: whether the next frame must run the pass even if nothing changes that its outputs follow from.
    """

    def __init__(
        self,
        library: ShaderLibrary,
        step: Step,
        ports: Mapping[str, Resource | None],
        written: Mapping[tuple[str, str], Output],
        state: Any = None,
    ) -> None:
        self._library, self.step, self._ports, self.state = library, step, ports, state
        self.counters: Counter[str] = Counter()
        self.figures: Counter[str] = Counter()
        self.again = False
        self.stage: str | None = None
        self.gpu = library.gpu
        self._framebuffer: Framebuffer | None = None
        self._programs: dict[Any, Program] = {}
        textures = [name for name in step.work.inputs if isinstance(ports[name], GpuTexture)]
        sampled = [name for name in textures if not step.work.inputs[name].attach]
        self._units = {name: i for i, name in enumerate(sampled)}
        self.defines: dict[str, Define] = {f"UNIT_{name.upper()}": i for name, i in self._units.items()}
        self.metas: dict[str, Any] = {}
        for name, source in step.sources.items():
            self.defines[f"HAS_{name.upper()}"] = int(source is not None)
            if source:
                self.defines |= written[source].defines
                self.metas[name] = written[source].meta
        for output in step.outputs.values():
            self.defines |= output.defines
        images = [name for name, output in step.outputs.items() if output.image]
        self._images = {name: i for i, name in enumerate(images)}
        self.defines |= {f"IMAGE_{name.upper()}": i for name, i in self._images.items()}
        target = 0
        for name, output in step.outputs.items():
            if output.attach and (targets := _count_targets(ports[name])):
                self.defines[f"TARGET_{name.upper()}"] = target
                target += targets

    def __getitem__(self, port: str) -> Any:
        if port not in self._ports:
            raise KeyError(f"{self.step.name} declares no port '{port}'; it has: {', '.join(self._ports)}")
        return self._ports[port]

    def meta(self, port: str, kind: type[Meta]) -> Meta:
        """Return the `Output.meta`, of type `kind`, of the output that is connected to the input `port`."""
        found = self.metas[port]
        if not isinstance(found, kind):
            raise TypeError(f"{self.step.name}.{port}: carries {type(found).__name__}, and {kind.__name__} is wanted")
        return found

    @property
    def framebuffer(self) -> Framebuffer:
        """The pass's textures as a render target, bound when `execute` begins."""
        if self._framebuffer is None:
            raise ValueError(f"{self.step.name}: has no output to draw into")
        return self._framebuffer

    def attach(self, framebuffer: Framebuffer) -> None:
        """Set the pass's render target."""
        self._framebuffer = framebuffer

    def begin(self, find_computed: Callable[[], Collection[str]] = frozenset) -> None:
        """Prepare a run: bind the framebuffer, all sampled inputs and images, and publish nothing yet.

        find_computed: see `find_stage`.
        """
        self.stage = find_stage(self.step.work, find_computed)
        self.counters.clear()
        self.figures.clear()
        self.again = False
        if self._framebuffer:
            self._framebuffer.bind()
        for name, unit in self._units.items():
            port = self.step.work.inputs[name]
            self[name].bind(unit, self.gpu.sampler(port.linear, port.compare))
        if self._stores:
            for name, unit in self._images.items():
                self[name].bind_image(unit)

    def end(self) -> None:
        """Finish a run: let others see what shaders stored into images."""
        if self._stores:
            self.gpu.barrier()

    @property
    def _stores(self) -> bool:
        """Whether shaders of this run store into images."""
        return bool(self._images) and self.stage != "fragment"

    def program(self, *files: str, defines: Mapping[str, Define] = NO_DEFINES) -> Program:
        """Return the program of these shader files, one a stage; they know the defines of the ports and `defines`."""
        key = (*files, *defines.items())
        if key not in self._programs:
            folder = self.step.work.shader_folder
            program = self._library.program(*files, defines={**self.defines, **defines}, folder=folder)
            unknown = program.samplers - SCENE_SAMPLERS - set(self.step.work.inputs)
            if unknown:
                raise ShaderError(f"{program.name}: sampler '{min(unknown)}' is no input of pass {self.step.name}")
            self._programs[key] = program
        return self._programs[key]

    def stage_program(self, file: str, defines: Mapping[str, Define] = NO_DEFINES) -> Program:
        """Return the program of a shader file, named without its suffix, in the stage that this run is in."""
        assert self.stage, f"{self.step.name} has no parameter 'stage'"
        return self.program(file + SUFFIXES[self.stage], defines=defines)

    def cover(self, program: Program, rectangles: Iterable[Rectangle]) -> None:
        """Run a program for each texel of rectangles x, y, width, height: draw into the bound target, or dispatch."""
        for rectangle in rectangles:
            if program.computes:
                program.dispatch(rectangle)
            else:
                self.gpu.scissor(rectangle)
                program.draw_fullscreen()
        self.gpu.scissor(None)

    def fit(self, port: str, layers: int) -> None:
        """Give the texture `port`, one that grows and is drawn into, room for `layers` layers.

        If it is allocated anew for that, so is `state`: the old one may describe texels that are gone.
        """
        before = self[port].version
        try:
            self[port].fit(layers)
        except DeviceError as error:
            raise DeviceError(f"{self.step.name}.{port}: {error}") from error
        finally:
            if self[port].version != before:
                self.forget()
                self.framebuffer.attach()

    def forget(self) -> None:
        """Start over with a new `state`."""
        self.state = new_state(self.step.work)

    def count(self, name: str, value: int) -> None:
        """Publish how much work this run did, such as the number of maps drawn; none if the pass is skipped."""
        self.counters[name] += value

    def report(self, name: str, value: int) -> None:
        """Publish a figure of what the outputs hold, such as the number of VPLs alive."""
        self.figures[name] += value

    def repeat(self) -> None:
        """Let the next frame run the pass in any case: its state has not come to rest."""
        self.again = True


def new_state(work: Pass) -> Any:
    """Return the state that a pass starts with, None if it declares none."""
    return None if work.State is None else work.State()


def single_resources(resource: Resource | None) -> Sequence[GpuTexture | GpuBuffer]:
    """Return the textures and buffers of a port, of which `Texture.copies` makes several."""
    return resource if isinstance(resource, list) else [resource] if resource else []


def _count_targets(resource: Resource | None) -> int:
    """Colour targets that a texture is, each layer of an array one."""
    if not isinstance(resource, GpuTexture) or resource.format.depth:
        return 0
    return max(resource.layers, 1)
