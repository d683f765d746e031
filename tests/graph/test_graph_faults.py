"""Compiling graphs: every fault is told, and all at once. No OpenGL."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import pytest
from fake_passes import SHINES, Fake, graph, reads, source

from deferred_ir.base.errors import GraphError
from deferred_ir.graph.compile import compile
from deferred_ir.graph.facts import NOTHING_KNOWN, Facts
from deferred_ir.graph.graph import Graph
from deferred_ir.graph.ports import Buffer, Output, Texture


def faults(broken: Graph, outputs: Sequence[str] = ("image",), facts: Facts = NOTHING_KNOWN, **options: Any) -> str:
    """The message of the one error: one line that begins with the graph's file."""
    with pytest.raises(GraphError) as raised:
        compile(broken, outputs, facts, **options)
    message = str(raised.value)
    assert message.startswith("some.toml: ")
    assert "\n" not in message
    return message.removeprefix("some.toml: ")


def test_an_input_that_the_pass_does_not_have():
    broken = graph(depth=source(), light=(Fake(reads("depth")), {"depth": "depth.out", "deph": "depth.out"}))
    assert faults(broken) == "light: no input 'deph'; did you mean 'depth'?"


def test_an_input_of_a_pass_without_any():
    assert faults(graph(light=(Fake(), {"depth": "light.out"}))) == "light: no input 'depth'"


def test_a_port_that_is_input_and_output():
    broken = graph(depth=source(), light=(Fake(reads("out")), {"out": "depth.out"}))
    assert faults(broken) == "light.out: is an input and an output; rename one of them"


def test_a_part_of_a_frame_that_does_not_exist():
    work = Fake()
    work.depends = lambda: frozenset({"camera", "lights"})
    told = faults(graph(light=(work, {})), parts=("camera", "light"))
    assert told == "light: depends(): no part of a frame is 'lights'; did you mean 'light'?"


def test_a_fact_that_no_constant_declares():
    """By its name it would never be found: a misspelt one would count as unknown for ever."""
    asks, states = Fake(), Fake()
    asks.unneeded = lambda facts: facts["shines"] and None
    states.state_facts = lambda facts: {"shines": False}
    told = faults(graph({"a": "asks.out", "b": "states.out"}, asks=(asks, {}), states=(states, {})), ("a", "b"))
    assert told == (
        "states: state_facts(): 'shines' is no Fact; give the constant that declares it; "
        "asks: facts['shines']: is no Fact; ask by the constant that declares it, such as EMITS"
    )


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


@pytest.mark.parametrize(
    ("description", "told"),
    [
        (Texture("depth32f"), "depth32f frame"),
        (Texture("rgba8", copies=2), "rgba8 frame, 2 of them"),
        (Buffer("light", 5, 80), "5 light"),
    ],
)
def test_an_image_of_what_shaders_cannot_store_into(description, told):
    class Stores(Fake):
        def outputs(self, inputs):
            return {"out": Output("", description, image=True)}

    assert faults(graph(light=(Stores(), {}))) == (
        f"light.out: shaders store into no {told}; declare one colour texture, such as rgba32f"
    )


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
    assert set(pairwise(around)) == wires  # the way the data goes


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
    assert faults(broken, facts=Facts({SHINES: False})) == (
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
