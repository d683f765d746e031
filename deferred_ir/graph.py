"""The render graph: passes with ports, and `compile`, which turns them into a plan. Pure: no OpenGL, no files.

A pass declares its inputs as data and answers, from its parameters and what its inputs are, what it writes. A graph
wires ports by name at the reader (`inputs = {depth = "gbuffer.depth"}`), so an output has one writer by construction.
Names are one thing everywhere: a port is the sampler's name in GLSL and the key in the graph file.

Ideas: pure reflection and all faults at once (Falcor), compilation as a short list of steps (Granite), culling by a
backward walk and tests without a GPU (Filament), descriptions derived from inputs (kajiya).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from typing import Any, ClassVar

from .errors import GraphError, did_you_mean
from .params import NoParams


@dataclass(frozen=True)
class Texture:
    """A texture: `size` (width, height), None for the frame's; `layers` > 0 makes it an array.

    `copies` > 0 makes that many separate textures, which the pass itself attaches and binds one by one. `mend` says
    what to use where a driver takes none as large.
    """

    format: str
    size: tuple[int, int] | None = None
    layers: int = 0
    copies: int = 0
    mend: str = field(default="a smaller size", compare=False)

    def __str__(self) -> str:
        size = "frame" if self.size is None else f"{self.size[0]}x{self.size[1]}"
        many = f" x {self.layers} layers" if self.layers else f", {self.copies} of them" if self.copies else ""
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
    """

    doc: str
    description: Description
    defines: Mapping[str, int | float] = field(default_factory=dict)
    attach: bool = True


NO_PORTS: Mapping[str, Any] = {}


@dataclass(frozen=True)
class Facts:
    """What compile() may know of scene and settings, to leave passes out."""

    emits: bool = True
    """The spotlight has power."""

    clamped: bool = True
    """VPLs light what is near them with less than they should."""

    triangles: int = 0
    pixels: int = 512 * 512

    shares: int = 1
    """A pixel is lit by one in so many VPLs."""

    software: bool = True
    """OpenGL draws on the CPU."""


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

    def subpasses(
        self, inputs: Mapping[str, Description | None], ports: Mapping[str, Any] = NO_PORTS
    ) -> Sequence[Mapping[str, Any]]:
        """The parts that the pass plans for itself, one dictionary each, for whoever looks at the plan.

        ports: its resources after a frame; then the parts are those of that frame.
        """
        del inputs, ports
        return ()

    def execute(self, frame: Any, io: Any) -> None:
        """Do the work of one frame: `frame` is an executor.Frame, `io` an executor.Io with the pass's ports."""
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


def compile(graph: Graph, outputs: Sequence[str], facts: Facts = Facts()) -> Plan:
    """The plan that produces `outputs` (names in graph.outputs) for a scene with these facts.

    Raises one GraphError that lists all faults.
    """
    faults: list[str] = []
    roots, edges = _resolve(graph, outputs, faults)
    for node in graph.nodes.values():
        facts = node.work.informed(facts)
    unneeded = _leave_out(graph, edges, facts)
    for name, (source, _) in roots.items():
        if source in unneeded:
            faults.append(f"output '{name}' comes from {source}, which is left out: {unneeded[source]}")
    reached = _reach(roots, edges, unneeded)
    steps = _describe(graph, edges, _order(edges, reached, faults), faults)
    if faults:
        told = " ".join("; ".join(faults).split())  # a name may hold a line break
        raise GraphError(f"{graph.origin}: {told}")
    left_out = {name: unneeded.get(name, "no requested output needs it") for name in graph.nodes if name not in reached}
    return Plan(steps, roots, left_out, _lifetimes(steps, roots))


Edges = dict[str, dict[str, tuple[str, str] | None]]
Roots = dict[str, tuple[str, str]]


def _resolve(graph: Graph, outputs: Sequence[str], faults: list[str]) -> tuple[Roots, Edges]:
    """Names to (pass, port) pairs. Whether a source has that port is known once it is described."""

    def source(text: str, where: str) -> tuple[str, str] | None:
        name, dot, port = text.partition(".")
        if not dot or not name or not port:
            faults.append(f"{where}: '{text}' is no source; write \"pass.port\"")
        elif name not in graph.nodes:
            faults.append(f"{where}: no pass '{name}'{did_you_mean(name, graph.nodes)}")
        else:
            return name, port
        return None

    edges: Edges = {}
    for node in graph.nodes.values():
        edges[node.name] = dict.fromkeys(node.work.inputs)
        for port, text in node.inputs.items():
            if port not in node.work.inputs:
                faults.append(f"{node.name}: no input '{port}'{did_you_mean(port, node.work.inputs)}")
            else:
                edges[node.name][port] = source(text, f"{node.name}.{port}")
        for port, declared in node.work.inputs.items():
            if not declared.optional and port not in node.inputs:
                faults.append(f'{node.name}.{port}: not connected; add inputs = {{ {port} = "pass.port" }}')
    roots: Roots = {}
    for name in outputs:
        if name not in graph.outputs:
            faults.append(f"no output '{name}'{did_you_mean(name, graph.outputs)}")
        elif found := source(graph.outputs[name], f"outputs.{name}"):
            roots[name] = found
    return roots, edges


def _leave_out(graph: Graph, edges: Edges, facts: Facts) -> dict[str, str]:
    """Passes that this scene does not need or others replace, and those that cannot run without them."""
    unneeded = {node.name: why for node in graph.nodes.values() if (why := node.work.unneeded(facts))}
    wires = [(name, port, source) for name, ports in edges.items() for port, source in ports.items() if source]

    def spread() -> None:
        known = -1
        while known < len(unneeded):
            known = len(unneeded)
            for name, port, (source, _) in wires:
                if source in unneeded and not graph.nodes[name].work.inputs[port].optional:
                    unneeded.setdefault(name, f"its input {port} comes from {source}, which is left out")

    spread()
    for name, port, (source, _) in wires:
        if source not in unneeded and graph.nodes[name].work.inputs[port].replaces:
            unneeded.setdefault(name, f"{source} makes it needless")
    spread()
    for name, port, (source, _) in wires:
        if source in unneeded:
            edges[name][port] = None
    return unneeded


def _reach(roots: Roots, edges: Edges, unneeded: Mapping[str, str]) -> set[str]:
    """The backward walk: every pass that a requested output needs."""
    reached: set[str] = set()
    stack = [name for name, _ in roots.values()]
    while stack:
        name = stack.pop()
        if name not in reached and name not in unneeded:
            reached.add(name)
            stack.extend(source[0] for source in edges[name].values() if source)
    return reached


def _order(edges: Edges, reached: set[str], faults: list[str]) -> list[str]:
    """Writers before readers; the same file always gives the same order."""
    ahead = {name: [source[0] for source in edges[name].values() if source] for name in edges if name in reached}
    while True:
        try:
            return list(TopologicalSorter(ahead).static_order())
        except CycleError as error:
            cycle = error.args[1]
            faults.append("cycle: " + " -> ".join(cycle) + "; remove one of these inputs")
            ahead = {name: sources for name, sources in ahead.items() if name not in cycle}


def _describe(graph: Graph, edges: Edges, order: list[str], faults: list[str]) -> tuple[Step, ...]:
    """Ask each pass what it writes, given what it reads, and hold both ends of each wire together."""
    steps: dict[str, Step] = {}
    for name in order:
        work, descriptions = graph.nodes[name].work, dict[str, Description | None]()
        wires = {port: source for port, source in edges[name].items() if source}
        required = {port for port, declared in work.inputs.items() if not declared.optional}
        for port, (source, written) in wires.items():
            if source not in steps:
                continue  # at fault already; what it would write is unknown
            outputs = steps[source].outputs
            if written not in outputs:
                faults.append(f"{name}.{port}: {source} has no output '{written}'{did_you_mean(written, outputs)}")
                continue
            found, wanted = outputs[written].description, work.inputs[port].format
            if wanted in (None, found.format):
                descriptions[port] = found
            else:
                faults.append(f"{name}.{port} wants {wanted}, but {source}.{written} is {found.format}")
        if descriptions.keys() >= wires.keys() | required:
            described = dict.fromkeys(work.inputs) | descriptions
            try:
                step = Step(name, work, edges[name], work.outputs(described), described)
            except GraphError as error:
                faults.append(f"{name}: {error}")
                continue
            steps[name] = step
            both = sorted(step.outputs.keys() & work.inputs.keys())
            faults.extend(f"{name}.{port}: is an input and an output; rename one of them" for port in both)
    for name, text in graph.outputs.items():
        source_name, _, port = text.partition(".")
        if source_name in steps and port not in steps[source_name].outputs:
            hint = did_you_mean(port, steps[source_name].outputs)
            faults.append(f"outputs.{name}: {source_name} has no output '{port}'{hint}")
    return tuple(steps.values())


def _lifetimes(steps: tuple[Step, ...], roots: Roots) -> dict[tuple[str, str], tuple[int, int]]:
    """First writer and last reader of each resource, as indices of steps; requested outputs live to the end."""
    spans = {(step.name, port): (i, i) for i, step in enumerate(steps) for port in step.outputs}
    for i, step in enumerate(steps):
        for source in step.sources.values():
            if source:
                spans[source] = (spans[source][0], i)
    return spans | {root: (spans[root][0], len(steps) - 1) for root in roots.values()}
