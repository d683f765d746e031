"""The render graph: passes with ports, wired by name. `planning.compile` turns one into a plan. Pure: no OpenGL.

A pass declares its inputs as data and answers, from its parameters and what its inputs are, what it writes. A graph
wires ports by name at the reader (`inputs = {depth = "gbuffer.depth"}`), so an output has one writer by construction.
Names are one thing everywhere: a port is the sampler's name in GLSL and the key in the graph file.

Ideas: pure reflection (Falcor), descriptions derived from inputs (kajiya).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, ClassVar

from deferred_ir.graph.params import NoParams


@dataclass(frozen=True)
class Texture:
    """A texture: `size` (width, height), None for the frame's; `layers` > 0 makes it an array.

    `copies` > 0 makes that many separate textures, which the pass itself attaches and binds one by one. `grows`: it
    begins with one layer, and its pass asks for as many as a frame needs, `layers` at most. `mend` says what to use
    where a driver takes none as large.
    """

    format: str
    size: tuple[int, int] | None = None
    layers: int = 0
    copies: int = 0
    grows: bool = False
    mend: str = field(default="a smaller size", compare=False)

    def __str__(self) -> str:
        size = "frame" if self.size is None else f"{self.size[0]}x{self.size[1]}"
        most = "up to " if self.grows else ""
        many = f" x {most}{self.layers} layers" if self.layers else f", {self.copies} of them" if self.copies else ""
        return f"{self.format} {size}{many}"


@dataclass(frozen=True)
class Buffer:
    """A buffer of up to `records` records of `format`, `stride` bytes each, allocated in blocks of `block` records.

    parts: how many nearly equal parts its records are dealt into, one after the other.
    """

    format: str
    records: int
    stride: int
    block: int = 1
    parts: int = 1

    def __str__(self) -> str:
        return f"{self.records} {self.format}"


Description = Texture | Buffer


@dataclass(frozen=True)
class Input:
    """A port that reads. `format` None takes any. Filter and comparison belong to the reader, not to the texture.

    `attach`: a depth texture that the pass tests against, attached to its framebuffer instead of sampled.
    `replaces`: optional, and where it is connected the pass is left out, for its readers use the source instead.
    """

    doc: str
    format: str | None = None
    optional: bool = False
    linear: bool = False
    compare: str | None = None
    attach: bool = False
    replaces: bool = False


@dataclass(frozen=True)
class Output:
    """A port that writes. `defines` tell the readers' shaders what they must know of the writer (layout, encoding).

    `attach` False: a texture that shaders store into wherever they like, instead of a target of the pass's framebuffer.
    `spare`: the pass can do without it, and does where nothing reads it; its shader asks for `TARGET_<PORT>`.
    `transient`: a texture that each frame writes whole and the next does not read, so that once its last reader is done
    another output of the same description may use it.
    """

    doc: str
    description: Description
    defines: Mapping[str, int | float] = field(default_factory=dict)
    attach: bool = True
    spare: bool = False
    transient: bool = False


NO_PORTS: Mapping[str, Any] = {}
FRAME_PARTS = frozenset({"camera", "light", "models", "seed", "time"})
"""What a pass can read of a frame; `camera` includes the frame's size."""


@dataclass(frozen=True)
class Facts:
    """What compile() may know of scene and settings, to leave passes out."""

    emits: bool = True
    """The spotlight has power."""

    vpls: bool = True
    """VPLs may shine."""

    clamped: bool = True
    """VPLs light what is near them with less than they should."""

    triangles: int = 0
    pixels: int = 512 * 512

    shares: int = 1
    """A pixel is lit by one in so many VPLs."""

    software: bool = True
    """OpenGL draws on the CPU."""

    keep_all: bool = False
    """Nothing is left out that another scene would need."""

    @property
    def kept(self) -> Facts:
        """With `keep_all` those of a scene that needs every pass."""
        return replace(self, emits=True, vpls=True, clamped=True) if self.keep_all else self


class Pass:
    """Base of all passes: ports and parameters as data, `execute` does the work each frame."""

    Params: ClassVar[type] = NoParams
    inputs: ClassVar[Mapping[str, Input]] = {}
    gives_back: ClassVar[bool] = False
    """It adds the light that VPLs' clamp takes (`bias` in RUN.json)."""
    shader_folder: ClassVar[Path | None] = None
    """Where a user's pass keeps its shaders; searched before the package's own."""

    def __init__(self, params: Any = None) -> None:
        self.params = self.Params() if params is None else params

    def outputs(self, inputs: Mapping[str, Description | None]) -> Mapping[str, Output]:
        """What it writes, a pure function of its parameters and its inputs' descriptions (None: not connected).

        Raises GraphError for what does not fit together; `compile` adds the pass's name.
        """
        raise NotImplementedError

    def informed(self, facts: Facts) -> Facts:
        """`facts` and what this pass's parameters add to them for the other passes."""
        return facts

    def unneeded(self, facts: Facts) -> str | None:
        """Why this scene does not need the pass, or None."""
        del facts
        return None

    def depends(self) -> frozenset[str]:
        """Of which FRAME_PARTS its outputs are made, besides its parameters and inputs: all, unless it names fewer.

        Where frames are reused, it runs only if one of them has changed.
        """
        return FRAME_PARTS

    def frames_to_fill(self) -> int:
        """Frames of a still scene until what it keeps from frame to frame is complete: one, unless it says more."""
        return 1

    def subpasses(
        self, inputs: Mapping[str, Description | None], ports: Mapping[str, Any] = NO_PORTS
    ) -> Sequence[Mapping[str, Any]]:
        """The parts that the pass plans for itself, one dictionary each, for whoever looks at the plan.

        ports: its resources after a frame; then the parts are those of that frame.
        """
        del inputs, ports
        return ()

    def execute(self, frame: Any, io: Any) -> None:
        """Do the work of one frame: `frame` is a frame.Frame, `io` an io.Io with the pass's ports."""
        raise NotImplementedError


@dataclass(frozen=True)
class Node:
    """A pass under its name in a graph; `inputs` maps its ports to sources `pass.port`."""

    name: str
    work: Pass
    inputs: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Graph:
    """Nodes by name, and the outputs that a caller can ask for, each a source `pass.port`. `origin`: its file."""

    nodes: Mapping[str, Node]
    outputs: Mapping[str, str]
    origin: str = "graph"


@dataclass(frozen=True)
class Step:
    """A node with everything resolved. `sources`: port -> (pass, port), None where nothing is connected."""

    name: str
    work: Pass
    sources: Mapping[str, tuple[str, str] | None]
    outputs: Mapping[str, Output]
    descriptions: Mapping[str, Description | None]


@dataclass(frozen=True)
class Plan:
    """What runs, in order; why the rest does not; and when each resource is first written and last read."""

    steps: tuple[Step, ...]
    outputs: Mapping[str, tuple[str, str]]
    left_out: Mapping[str, str]
    lifetimes: Mapping[tuple[str, str], tuple[int, int]]

    def tenants(self) -> dict[tuple[str, str], tuple[str, str]]:
        """Transient outputs that can use the texture of one whose last reader is done by then: whose."""
        found: dict[tuple[str, str], tuple[str, str]] = {}
        free: list[tuple[str, str]] = []
        described = {(s.name, port): output for s in self.steps for port, output in s.outputs.items()}
        transient = {source: output.description for source, output in described.items() if output.transient}
        for number, step in enumerate(self.steps):
            for source in [(step.name, port) for port in step.outputs if (step.name, port) in transient]:
                home = next((other for other in free if transient[other] == transient[source]), None)
                if home:
                    free.remove(home)
                    found[source] = home
            free += [found.get(source, source) for source in transient if self.lifetimes[source][1] == number]
        return found

    @property
    def frames_to_fill(self) -> int:
        """Frames of a still scene until the picture is what it is to be; 1 where nothing is kept between frames."""
        return max((step.work.frames_to_fill() for step in self.steps), default=1)
