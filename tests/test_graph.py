"""Compiling graphs: every fault, and what runs when and why. No OpenGL."""

from __future__ import annotations

import os
import random
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from deferred_ir.errors import GraphError
from deferred_ir.graph import Buffer, Facts, Graph, Input, Node, Output, Pass, Texture, compile


class Fake(Pass):
    """A pass with these ports; `unneeded_because` is its answer to a scene whose light is off."""

    def __init__(
        self,
        inputs: Mapping[str, Input] | None = None,
        outputs: Mapping[str, str] | None = None,
        unneeded_because: str | None = None,
    ) -> None:
        super().__init__()
        self.inputs = inputs or {}
        self.written = {"out": "rgba8"} if outputs is None else outputs
        self.reason = unneeded_because

    def outputs(self, inputs):
        assert set(inputs) == set(self.inputs)
        return {port: Output("", Texture(format)) for port, format in self.written.items()}

    def unneeded(self, facts):
        return None if facts.emits else self.reason


def graph(outputs: Mapping[str, str] | None = None, /, **nodes: tuple[Pass, Mapping[str, str]]) -> Graph:
    made = {name: Node(name, work, wires) for name, (work, wires) in nodes.items()}
    return Graph(made, outputs or {"image": f"{list(nodes)[-1]}.out"}, "some.toml")


def reads(*ports: str, **options: Any) -> dict[str, Input]:
    return {port: Input("", **options) for port in ports}


def source(format: str = "rgba8", **more: str) -> tuple[Pass, Mapping[str, str]]:
    return Fake(outputs={"out": format, **more}), {}


def faults(broken: Graph, outputs: Sequence[str] = ("image",), facts: Facts = Facts()) -> str:
    """The message of the one error: one line that begins with the graph's file."""
    with pytest.raises(GraphError) as raised:
        compile(broken, outputs, facts)
    message = str(raised.value)
    assert message.startswith("some.toml: ")
    assert "\n" not in message
    return message.removeprefix("some.toml: ")


def names(plan) -> list[str]:
    return [step.name for step in plan.steps]


# Faults


def test_an_input_that_the_pass_does_not_have():
    broken = graph(depth=source(), light=(Fake(reads("depth")), {"depth": "depth.out", "deph": "depth.out"}))
    assert faults(broken) == "light: no input 'deph'; did you mean 'depth'?"


def test_an_input_of_a_pass_without_any():
    assert faults(graph(light=(Fake(), {"depth": "light.out"}))) == "light: no input 'depth'"


def test_a_required_input_that_is_not_connected():
    broken = graph(light=(Fake(reads("depth")), {}))
    assert faults(broken) == 'light.depth: not connected; add inputs = { depth = "pass.port" }'


def test_a_source_pass_that_does_not_exist():
    broken = graph(gbuffer=source(), light=(Fake(reads("depth")), {"depth": "gbufer.out"}))
    assert faults(broken) == "light.depth: no pass 'gbufer'; did you mean 'gbuffer'?"


def test_a_source_port_that_does_not_exist():
    broken = graph(gbuffer=source(depth="depth32f"), light=(Fake(reads("depth")), {"depth": "gbuffer.dept"}))
    assert faults(broken) == "light.depth: gbuffer has no output 'dept'; did you mean 'depth'?"


@pytest.mark.parametrize("text", ["gbuffer", "gbuffer.", ".out", ".", "", "gbuffer,out"])
def test_a_source_that_is_none(text):
    broken = graph(gbuffer=source(), light=(Fake(reads("depth")), {"depth": text}))
    assert faults(broken) == f"light.depth: '{text}' is no source; write \"pass.port\""


def test_a_port_of_another_format():
    broken = graph(gbuffer=source("depth32f"), light=(Fake(reads("depth", format="rgba8")), {"depth": "gbuffer.out"}))
    assert faults(broken) == "light.depth wants rgba8, but gbuffer.out is depth32f"


def test_a_buffer_where_a_texture_is_wanted():
    class Lights(Fake):
        def outputs(self, inputs):
            return {"out": Output("", Buffer("light", 5, 80))}

    broken = graph(vpl=(Lights(), {}), light=(Fake(reads("depth", format="rgba8")), {"depth": "vpl.out"}))
    assert faults(broken) == "light.depth wants rgba8, but vpl.out is light"


def test_a_cycle_is_named():
    broken = graph(
        a=(Fake(reads("x")), {"x": "c.out"}),
        b=(Fake(reads("x")), {"x": "a.out"}),
        c=(Fake(reads("x")), {"x": "b.out"}),
    )
    message = faults(broken)
    assert message.startswith("cycle: ")
    around = message.removeprefix("cycle: ").partition(";")[0].split(" -> ")
    assert around[0] == around[-1]
    assert sorted(around[1:]) == ["a", "b", "c"]
    wires = {(node.inputs["x"].partition(".")[0], name) for name, node in broken.nodes.items()}
    assert set(zip(around[:-1], around[1:], strict=True)) == wires  # the way the data goes


def test_a_pass_that_reads_itself():
    assert faults(graph(a=(Fake(reads("x")), {"x": "a.out"}))).startswith("cycle: a -> a;")


def test_an_output_that_the_graph_does_not_have():
    assert faults(graph({"radiance": "a.out"}, a=source()), ["radianze"]) == (
        "no output 'radianze'; did you mean 'radiance'?"
    )


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("b.out", "outputs.image: no pass 'b'; known: a"),
        ("a.oud", "outputs.image: a has no output 'oud'; did you mean 'out'?"),
        ("a", "outputs.image: 'a' is no source; write \"pass.port\""),
    ],
)
def test_an_output_that_leads_nowhere(text, message):
    assert faults(graph({"image": text}, a=source())) == message


def test_an_output_of_a_pass_that_is_left_out():
    broken = graph(a=(Fake(unneeded_because="the light is off"), {}))
    assert faults(broken, facts=Facts(emits=False)) == (
        "output 'image' comes from a, which is left out: the light is off"
    )


def test_all_faults_are_told_at_once_whatever_their_kind():
    broken = graph(
        {"image": "end.out", "second": "nowhere.out"},
        gbuffer=source("depth32f"),
        wrong_name=(Fake(reads("a")), {"b": "gbuffer.out"}),
        wrong_source=(Fake(reads("a")), {"a": "gbufer.out"}),
        wrong_port=(Fake(reads("a")), {"a": "gbuffer.oud"}),
        wrong_format=(Fake(reads("a", format="rgba8")), {"a": "gbuffer.out"}),
        round=(Fake(reads("a")), {"a": "round.out"}),
        after=(Fake(reads("a")), {"a": "wrong_port.nothing"}),  # not judged: what it reads is at fault
        end=(
            Fake(reads("a", "b", "c", "d", "e", "f")),
            {
                "a": "wrong_name.out",
                "b": "wrong_source.out",
                "c": "wrong_port.out",
                "d": "wrong_format.out",
                "e": "round.out",
                "f": "after.out",
            },
        ),
    )
    told = faults(broken, ["image", "second", "third"])
    for part in (
        "wrong_name: no input 'b'",
        "wrong_name.a: not connected",
        "wrong_source.a: no pass 'gbufer'",
        "wrong_port.a: gbuffer has no output 'oud'",
        "wrong_format.a wants rgba8, but gbuffer.out is depth32f",
        "cycle: round -> round",
        "outputs.second: no pass 'nowhere'",
        "no output 'third'",
    ):
        assert told.count(part) == 1, part
    assert "after." not in told


def test_two_cycles_are_both_named():
    broken = graph(
        a=(Fake(reads("x")), {"x": "a.out"}),
        b=(Fake(reads("x")), {"x": "b.out"}),
        c=(Fake(reads("x", "y")), {"x": "a.out", "y": "b.out"}),
    )
    told = faults(broken)
    assert "cycle: a -> a" in told
    assert "cycle: b -> b" in told


def test_a_pass_that_refuses_its_inputs_is_one_fault_among_the_others():
    class Refuses(Fake):
        def outputs(self, inputs):
            raise GraphError("3 layers are too many; use fewer")

    broken = graph(
        bad=(Refuses(), {}),
        a=source(),
        b=(Fake(reads("x", "y")), {"x": "a.oud", "y": "bad.out"}),
    )
    told = faults(broken)
    assert "bad: 3 layers are too many; use fewer" in told
    assert "b.x: a has no output 'oud'" in told


# What is left out


def test_a_pass_that_no_output_needs_is_left_out_with_the_reason():
    plan = compile(graph({"image": "a.out"}, a=source(), b=(Fake(reads("x")), {"x": "a.out"})), ["image"])
    assert names(plan) == ["a"]
    assert plan.left_out == {"b": "no requested output needs it"}


def test_only_the_requested_outputs_count():
    both = graph({"one": "a.out", "two": "b.out"}, a=source(), b=source())
    assert names(compile(both, ["one"])) == ["a"]
    assert names(compile(both, ["two"])) == ["b"]
    assert set(names(compile(both, ["two", "one"]))) == {"a", "b"}
    assert compile(both, []).steps == ()


def test_an_optional_input_becomes_none_when_its_source_is_not_needed():
    chain = graph(
        maps=(Fake(unneeded_because="the light is off"), {}),
        light=(Fake(reads("shadows", optional=True)), {"shadows": "maps.out"}),
    )
    plan = compile(chain, ["image"], Facts(emits=False))
    assert names(plan) == ["light"]
    assert plan.steps[0].sources == {"shadows": None}
    assert plan.steps[0].descriptions == {"shadows": None}
    assert plan.left_out == {"maps": "the light is off"}
    on = compile(chain, ["image"], Facts(emits=True))
    assert names(on) == ["maps", "light"]
    assert on.steps[1].sources == {"shadows": ("maps", "out")}
    assert on.left_out == {}


def test_an_optional_input_may_stay_unconnected():
    plan = compile(graph(light=(Fake(reads("shadows", optional=True)), {})), ["image"])
    assert plan.steps[0].sources == {"shadows": None}


def test_what_is_left_out_takes_its_readers_along_up_to_an_optional_input():
    chain = graph(
        light=(Fake(reads("shadows", optional=True)), {"shadows": "blur.out"}),
        blur=(Fake(reads("maps")), {"maps": "filter.out"}),
        filter=(Fake(reads("raw")), {"raw": "maps.out"}),
        maps=(Fake(unneeded_because="the light is off"), {}),
        end=(Fake(reads("image")), {"image": "light.out"}),
    )
    plan = compile(chain, ["image"], Facts(emits=False))
    assert names(plan) == ["light", "end"]
    assert plan.left_out == {
        "maps": "the light is off",
        "filter": "its input raw comes from maps, which is left out",
        "blur": "its input maps comes from filter, which is left out",
    }


def test_what_only_left_out_passes_read_is_left_out_too():
    chain = graph(
        vertices=source(),
        maps=(Fake(reads("x"), unneeded_because="the light is off"), {"x": "vertices.out"}),
        light=(Fake(reads("shadows", optional=True)), {"shadows": "maps.out"}),
    )
    plan = compile(chain, ["image"], Facts(emits=False))
    assert plan.left_out == {"vertices": "no requested output needs it", "maps": "the light is off"}


# Order, lifetimes, descriptions


def diamond() -> Graph:
    return graph(
        end=(Fake(reads("l", "r")), {"l": "left.out", "r": "right.out"}),
        left=(Fake(reads("x")), {"x": "start.out"}),
        right=(Fake(reads("x")), {"x": "start.out"}),
        start=source(),
        **{"last": (Fake(reads("x")), {"x": "end.out"})},
    )


def test_writers_come_before_readers_in_the_same_order_every_time():
    orders = {tuple(names(compile(diamond(), ["image"]))) for _ in range(5)}
    assert orders == {("start", "left", "right", "end", "last")}


def test_the_order_is_the_same_in_every_process():
    script = (
        "import sys; sys.path.insert(0, 'tests')\n"
        "from test_graph import diamond, names\n"
        "from deferred_ir.graph import compile\n"
        "print(*names(compile(diamond(), ['image'])))\n"
        "assert 'moderngl' not in sys.modules and 'numpy' not in sys.modules\n"
    )
    for seed in ("1", "2"):
        assert python(script, PYTHONHASHSEED=seed) == "start left right end last"


def python(script: str, **environment: str) -> str:
    return subprocess.run(
        [sys.executable, "-c", script],
        cwd=Path(__file__).parent.parent,
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=True,
    ).stdout.strip()


def test_compiling_the_built_in_graphs_loads_no_opengl():
    assert "moderngl" not in python(
        "import sys\n"
        "from deferred_ir.config import graph_names, load_graph\n"
        "from deferred_ir.graph import compile\n"
        "for name in graph_names():\n"
        "    graph = load_graph(name)\n"
        "    compile(graph, list(graph.outputs))\n"
        "print(*sys.modules)\n"
    )


def test_a_resource_lives_from_its_writer_to_its_last_reader():
    chain = graph(
        {"image": "c.out", "early": "a.kept"},
        a=source(kept="rgba8", unread="rgba8"),
        b=(Fake(reads("x")), {"x": "a.out"}),
        c=(Fake(reads("x", "y")), {"x": "b.out", "y": "a.out"}),
    )
    plan = compile(chain, ["image", "early"])
    assert plan.lifetimes == {
        ("a", "out"): (0, 2),
        ("a", "kept"): (0, 2),  # asked for: to the end
        ("a", "unread"): (0, 0),
        ("b", "out"): (1, 2),
        ("c", "out"): (2, 2),
    }
    assert compile(chain, ["image"]).lifetimes["a", "kept"] == (0, 0)


def test_a_pass_derives_what_it_writes_from_what_it_reads():
    class Half(Fake):
        def outputs(self, inputs):
            read = inputs["x"]
            assert isinstance(read, Texture)
            return {"out": Output("", Texture(read.format, (read.size[0] // 2, read.size[1] // 2)))}

    class Big(Fake):
        def outputs(self, inputs):
            return {"out": Output("", Texture("r32f", (64, 32), layers=3))}

    plan = compile(
        graph(
            big=(Big(), {}),
            half=(Half(reads("x")), {"x": "big.out"}),
            quarter=(Half(reads("x", format="r32f")), {"x": "half.out"}),
        ),
        ["image"],
    )
    assert plan.steps[-1].outputs["out"].description == Texture("r32f", (16, 8))
    assert plan.steps[-1].descriptions == {"x": Texture("r32f", (32, 16))}


@given(st.integers(0, 12), st.randoms(use_true_random=False), st.booleans())
def test_any_graph_without_a_cycle_runs_what_is_needed_in_order(count: int, rng: random.Random, off: bool):
    """Random wiring of `count` passes, each reading earlier ones, in a shuffled file."""
    nodes: list[tuple[str, tuple[Pass, Mapping[str, str]]]] = []
    for i in range(count):
        wires = {f"in{k}": f"p{rng.randrange(i)}.out" for k in range(rng.randint(0, 3))} if i else {}
        ports = {port: Input("", optional=rng.random() < 0.3) for port in wires}
        nodes.append((f"p{i}", (Fake(ports, unneeded_because="off" if rng.random() < 0.2 else None), wires)))
    rng.shuffle(nodes)
    nodes.append(("end", (Fake(reads("x", optional=True)), {"x": f"p{count - 1}.out"} if count else {})))
    whole = graph(**dict(nodes))
    plan = compile(whole, ["image"], Facts(emits=not off))

    place = {name: i for i, name in enumerate(names(plan))}
    assert set(place) | set(plan.left_out) == set(whole.nodes)
    assert not set(place) & set(plan.left_out)
    needed = {"end"}
    for step in reversed(plan.steps):
        assert step.name in needed
        for port, wire in step.sources.items():
            if wire is None:
                assert step.work.inputs[port].optional
                assert whole.nodes[step.name].inputs.get(port, "p.").partition(".")[0] not in place
            else:
                assert place[wire[0]] < place[step.name]
                assert plan.lifetimes[wire][0] < place[step.name] <= plan.lifetimes[wire][1]
                needed.add(wire[0])
    if not off:
        assert "off" not in plan.left_out.values()
