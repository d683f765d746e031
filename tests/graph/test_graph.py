"""Compiling graphs: what runs, in what order, what is left out and why. No OpenGL."""

from __future__ import annotations

import os
import random
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

from fake_passes import SHINES, Fake, diamond, graph, names, reads, source
from hypothesis import given
from hypothesis import strategies as st

from deferred_ir.graph.compile import compile
from deferred_ir.graph.facts import Fact, Facts
from deferred_ir.graph.graph import Graph
from deferred_ir.graph.pass_base import Pass
from deferred_ir.graph.ports import Input, Output, Texture


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
    plan = compile(chain, ["image"], Facts({SHINES: False}))
    assert names(plan) == ["light"]
    assert plan.steps[0].sources == {"shadows": None}
    assert plan.steps[0].descriptions == {"shadows": None}
    assert plan.left_out == {"maps": "the light is off"}
    on = compile(chain, ["image"], Facts({SHINES: True}))
    assert names(on) == ["maps", "light"]
    assert on.steps[1].sources == {"shadows": ("maps", "out")}
    assert on.left_out == {}


COUNT = Fact("count", unknown=1, doc="How many lights a pixel sees.")


class Stating(Fake):
    """States how many lights a pixel sees."""

    def __init__(self, count: int):
        super().__init__()
        self.count = count

    def state_facts(self, facts):
        return {COUNT: self.count} if facts[SHINES] else {}


class Asking(Fake):
    """Not needed where pixels see several lights."""

    def unneeded(self, facts):
        return f"{facts[COUNT]} lights" if facts[COUNT] > 1 else None


def asked(*counts: int, **options):
    """Why a pass is left out where others state `counts`."""
    stating = {f"s{i}": (Stating(count), {}) for i, count in enumerate(counts)}
    light = (Fake(reads("x", optional=True)), {"x": "asking.out"})
    return compile(graph(asking=(Asking(), {}), **stating, light=light), ["image"], **options).left_out.get("asking")


def test_what_one_pass_states_counts_for_the_others():
    assert asked() is None
    assert asked(4) == asked(4, 4) == "4 lights"
    assert asked(4, facts=Facts({SHINES: False})) is None
    assert asked(1, facts=Facts({COUNT: 9})) is None


def test_where_passes_contradict_each_other_nothing_is_known():
    assert asked(4, 9) is asked(9, 4, 9) is None


def test_with_keep_all_only_the_needs_of_a_scene_count_as_unknown():
    assert asked(4, keep_all=True) == "4 lights"
    chain = graph(
        maps=(Fake(unneeded_because="the light is off"), {}),
        light=(Fake(reads("shadows", optional=True)), {"shadows": "maps.out"}),
    )
    assert compile(chain, ["image"], Facts({SHINES: False}), keep_all=True).left_out == {}


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
    plan = compile(chain, ["image"], Facts({SHINES: False}))
    assert names(plan) == ["light", "end"]
    assert plan.left_out == {
        "maps": "the light is off",
        "filter": "its input raw comes from maps, which is left out",
        "blur": "its input maps comes from filter, which is left out",
    }


def replaced(unneeded_because: str | None = None) -> Graph:
    """Maps that nobody needs where rays tell the same, unless these are left out themselves."""
    return graph(
        vertices=source(),
        pixels=(Fake(unneeded_because=unneeded_because), {}),
        rays=(Fake(reads("seen")), {"seen": "pixels.out"}),
        maps=(
            Fake(reads("x") | reads("rays", optional=True, replaces=True)),
            {"x": "vertices.out", "rays": "rays.out"},
        ),
        light=(Fake(reads("shadows", "rays", optional=True)), {"shadows": "maps.out", "rays": "rays.out"}),
    )


def test_a_pass_is_left_out_where_another_replaces_it():
    plan = compile(replaced(), ["image"])
    assert names(plan) == ["pixels", "rays", "light"]
    assert plan.steps[-1].sources == {"shadows": None, "rays": ("rays", "out")}
    assert plan.left_out == {"vertices": "no requested output needs it", "maps": "not needed: rays replaces it"}


def test_what_is_left_out_replaces_nothing():
    plan = compile(replaced("the light is off"), ["image"], Facts({SHINES: False}))
    assert names(plan) == ["vertices", "maps", "light"]
    assert plan.steps[-1].sources == {"shadows": ("maps", "out"), "rays": None}


def test_what_only_left_out_passes_read_is_left_out_too():
    chain = graph(
        vertices=source(),
        maps=(Fake(reads("x"), unneeded_because="the light is off"), {"x": "vertices.out"}),
        light=(Fake(reads("shadows", optional=True)), {"shadows": "maps.out"}),
    )
    plan = compile(chain, ["image"], Facts({SHINES: False}))
    assert plan.left_out == {"vertices": "no requested output needs it", "maps": "the light is off"}


def test_writers_come_before_readers_in_the_same_order_every_time():
    orders = {tuple(names(compile(diamond(), ["image"]))) for _ in range(5)}
    assert orders == {("start", "left", "right", "end", "last")}


def test_the_order_is_the_same_in_every_process():
    script = (
        "import sys; sys.path.insert(0, 'tests/support')\n"
        "from fake_passes import diamond, names\n"
        "from deferred_ir.graph.compile import compile\n"
        "print(*names(compile(diamond(), ['image'])))\n"
        "assert 'moderngl' not in sys.modules and 'numpy' not in sys.modules\n"
    )
    for seed in ("1", "2"):
        assert python(script, PYTHONHASHSEED=seed) == "start left right end last"


def python(script: str, **environment: str) -> str:
    return subprocess.run(
        [sys.executable, "-c", script],
        cwd=Path(__file__).parents[2],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=True,
    ).stdout.strip()


def test_compiling_the_built_in_graphs_loads_no_opengl():
    assert "moderngl" not in python(
        "import sys\n"
        "from deferred_ir.graph.file import graph_names, load_graph\n"
        "from deferred_ir.graph.compile import compile\n"
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
    plan = compile(whole, ["image"], Facts({SHINES: not off}))

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
