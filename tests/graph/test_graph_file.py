"""Graph files: the built-in ones, `extends`, settings, and every way in which a file can be wrong."""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from toml_text import to_toml

from deferred_ir.base.errors import GraphError
from deferred_ir.frame.facts import EMITS
from deferred_ir.graph import file, former_names
from deferred_ir.graph.compile import compile
from deferred_ir.graph.facts import Facts
from deferred_ir.graph.file import graph_hash, graph_names, load_graph
from deferred_ir.graph.graph import Graph
from deferred_ir.graph.params import param, specs
from deferred_ir.graph.pass_base import Pass
from deferred_ir.graph.ports import Input, Output, Texture
from deferred_ir.profiling.checks import visibility
from deferred_ir.profiling.limits.passes import LIMITS
from deferred_ir.profiling.studies import tessellation

SMALL = """
[outputs]
image = "end.out"
[passes.start]
type = "blur"
[passes.end]
type = "blur"
inputs = { image = "start.out" }
"""


@dataclass(frozen=True)
class Params:
    radius: float = param(1.0, lo=0.0, hi=9.0, doc="Radius.")
    steps: int = param(3, lo=1, doc="Steps.")


class Blur(Pass):
    """A pass of the user's own."""

    Params = Params
    inputs = {"image": Input("image", optional=True)}  # noqa: RUF012

    def outputs(self, inputs):
        return {"out": Output("", Texture("rgba8"))}


@dataclass(frozen=True)
class SplitParams:
    width: float = param(1.0, lo=0.0, hi=9.0, doc="Width.", formerly="blur.size")
    shape: int = param(0, doc="Shape.", formerly="end.shape")


class Split(Blur):
    """A pass to which parameters of `blur` and of the node `end` have moved."""

    Params = SplitParams


OWN = {"blur": Blur, "split": Split}


def write(folder: Path, text: str, name: str = "own.toml") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def fault(
    folder: Path, text: str, chosen: Mapping[str, Any] | None = None, passes: Mapping[str, type[Pass]] | None = OWN
) -> str:
    """The message of the error, which must be one line that begins with the file's name."""
    path = write(folder, text)
    with pytest.raises(GraphError) as raised:
        load_graph(path, chosen, passes)
    message = str(raised.value)
    assert message.startswith("own.toml: ")
    assert "\n" not in message
    return message.removeprefix("own.toml: ")


# Built-in graphs and passes


def test_the_graphs_of_the_contract_are_there():
    assert {"deferred", "forward"} <= set(graph_names())


@pytest.mark.parametrize("name", graph_names())
@pytest.mark.parametrize("emits", [True, False])
def test_every_built_in_graph_loads_and_compiles(name, emits):
    graph = load_graph(name)
    assert {"radiance", "display"} <= set(graph.outputs)
    plan = compile(graph, list(graph.outputs), Facts({EMITS: emits}))
    assert {step.name for step in plan.steps} | set(plan.left_out) == set(graph.nodes)


@pytest.mark.parametrize("name", graph_names())
def test_every_built_in_graph_says_what_it_is(name):
    first = (Path(file._graphs_folder()) / f"{name}.toml").read_text().splitlines()[0]
    assert first.startswith("# ")


@pytest.mark.parametrize("name", file.pass_types())
def test_every_pass_parameter_and_port_is_documented(name):
    work = importlib.import_module(f"{file.PASSES}.{name}").PASS
    assert issubclass(work, Pass)
    assert work.__doc__
    assert all(spec.doc.strip().endswith(".") for spec in specs(work.Params).values())
    assert all(spec.fault(spec.default) is None for spec in specs(work.Params).values())
    assert all(port.doc for port in work.inputs.values())


@pytest.mark.parametrize("name", graph_names())
def test_every_output_is_documented(name):
    plan = compile(load_graph(name), list(load_graph(name).outputs))
    assert all(output.doc for step in plan.steps for output in step.outputs.values())


# Files


def test_a_file_becomes_a_graph(tmp_path):
    graph = load_graph(
        write(tmp_path, SMALL.replace('type = "blur"\ninputs', 'type = "blur"\nsteps = 5\ninputs')), {}, OWN
    )
    assert set(graph.nodes) == {"start", "end"}
    assert isinstance(graph.nodes["end"].work, Blur)
    assert graph.nodes["end"].work.params == Params(steps=5)
    assert graph.nodes["end"].inputs == {"image": "start.out"}
    assert graph.outputs == {"image": "end.out"}
    assert graph.origin == "own.toml"


def test_a_pass_of_ones_own_wins_over_a_built_in_of_its_name(tmp_path):
    text = '[outputs]\nimage = "tonemap.out"\n[passes.tonemap]\nsteps = 2\n'
    assert isinstance(load_graph(write(tmp_path, text), {}, {"tonemap": Blur}).nodes["tonemap"].work, Blur)


def test_extends_overlays_table_by_table(tmp_path):
    write(tmp_path, SMALL, "base.toml")
    text = 'extends = "base.toml"\n[outputs]\nfirst = "start.out"\n[passes]\nend.radius = 2\nmore.type = "blur"\n'
    graph = load_graph(write(tmp_path, text), {}, OWN)
    assert graph.outputs == {"image": "end.out", "first": "start.out"}
    assert graph.nodes["end"].inputs == {"image": "start.out"}
    assert graph.nodes["end"].work.params == Params(radius=2.0)
    assert set(graph.nodes) == {"start", "end", "more"}


def test_extends_a_built_in_graph_and_a_chain_of_files_in_another_folder(tmp_path):
    (tmp_path / "sub").mkdir()
    write(tmp_path / "sub", 'extends = "deferred"\n[passes.vpl]\ncount = 5\nfov = 90\n', "one.toml")
    path = write(tmp_path, 'extends = "sub/one.toml"\n[passes.vpl]\ncount = 7\n')
    graph = load_graph(path)
    assert (graph.nodes["vpl"].work.params.count, graph.nodes["vpl"].work.params.fov) == (7, 90.0)
    assert set(graph.nodes) == set(load_graph("deferred").nodes)


def test_false_cuts_wires_and_outputs_of_the_extended_graph(tmp_path):
    text = 'extends = "deferred"\n[outputs]\ndisplay = false\n[passes]\nshadow_maps = false\ntonemap = false\n'
    graph = load_graph(write(tmp_path, text + "lighting.inputs = { shadows = false, blockers = false }\n"))
    plan = compile(graph, list(graph.outputs))
    assert [step.name for step in plan.steps] == [
        "lights",
        "light_points",
        "environment",
        "gbuffer",
        "vpl",
        "cull_lights",
        "lighting",
    ]
    assert plan.steps[-1].sources["shadows"] is None


def test_extends_does_not_change_the_graph_it_extends(tmp_path):
    before = graph_hash(load_graph("deferred"))
    load_graph(write(tmp_path, 'extends = "deferred"\n[passes.vpl]\ncount = 5\n'))
    assert graph_hash(load_graph("deferred")) == before


def test_false_removes_a_pass(tmp_path):
    write(tmp_path, SMALL, "base.toml")
    text = 'extends = "base.toml"\n[outputs]\nimage = "start.out"\n[passes]\nend = false\n'
    assert set(load_graph(write(tmp_path, text), {}, OWN).nodes) == {"start"}


def test_removing_a_pass_cuts_what_is_wired_to_it(tmp_path):
    text = 'extends = "deferred"\n[passes]\nshadow_maps = false\n'
    (lighting,) = [node for node in load_graph(write(tmp_path, text)).nodes.values() if node.name == "lighting"]
    assert not {"shadows", "blockers", "views"} & lighting.inputs.keys()
    assert lighting.inputs["depth"] == "gbuffer.depth"


def test_a_removed_pass_must_be_there(tmp_path):
    write(tmp_path, SMALL, "base.toml")
    assert fault(tmp_path, 'extends = "base.toml"\n[passes]\nebd = false\n') == (
        "passes.ebd: nothing to remove; did you mean 'end'?"
    )


def test_nothing_can_be_removed_without_a_base(tmp_path):
    assert "passes.end: wants a table" in fault(tmp_path, "[passes]\nend = false\n")


@pytest.mark.parametrize("chain", [["own.toml"], ["a.toml", "own.toml"], ["a.toml", "b.toml", "a.toml"]])
def test_a_file_that_extends_itself_is_told(tmp_path, chain):
    names = ["own.toml", *chain]
    for name, base in zip(names, chain, strict=False):
        write(tmp_path, f'extends = "{base}"\n{SMALL}', name)
    with pytest.raises(GraphError, match=r"extends itself; remove 'extends'"):
        load_graph(tmp_path / "own.toml", {}, OWN)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("defered", "graph 'defered': no such graph; did you mean 'deferred'?"),
        ("zzz", "graph 'zzz': no such graph; known: "),
        ("zzz.toml", "zzz.toml: no such graph file; built-in graphs: "),
        ("", "graph '': no such graph"),
        ("a\0b", "no such graph"),
        ("x" * 5000, "no such graph"),
    ],
    ids=lambda value: value[:12],
)
def test_a_graph_that_is_not_there(name, message):
    with pytest.raises(GraphError) as raised:
        load_graph(name)
    assert message in str(raised.value)


def test_a_base_that_is_not_there(tmp_path):
    path = write(tmp_path, 'extends = "defered"\n')
    with pytest.raises(GraphError, match="did you mean 'deferred'"):
        load_graph(path)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[passes", "not a TOML file: "),
        ("passes = 3", "passes: wants a table [passes.NAME] for each pass"),
        ("[[passes]]", "passes: wants a table [passes.NAME] for each pass"),
        ("extends = 3", "extends: wants the name or path of a graph"),
        ("outputs = 3", 'outputs: wants name = "pass.port" lines'),
        ("[outputs]\nimage = 3", 'outputs: wants name = "pass.port" lines'),
        ("[passes.end]\ntype='blur'", 'outputs: none; add a table [outputs] with radiance = "pass.port"'),
        ("[outputs]", "outputs: none; "),
        (SMALL + "[pases.end]\nradius = 1", "pases: no such key; did you mean 'passes'?"),
        ("[passes.end]\ntype = 'blurr'", "passes.end: no pass type 'blurr'; did you mean 'blur'?"),
        ("[passes.tonemapp]", "passes.tonemapp: no pass type 'tonemapp'; did you mean 'tonemap'?"),
        ("[passes.end]\ntype = 3", "passes.end.type: is 3, but wants the name of a pass type"),
        ("[passes.end]\ntype = []", "passes.end.type: is [], but wants the name of a pass type"),
        ("[passes.end]\ntype = {}", "passes.end.type: is {}, but wants the name of a pass type"),
        ("[passes]\nend = 3", "passes.end: wants a table of parameters and inputs"),
        ("[passes]\nend = true", "passes.end: wants a table of parameters and inputs"),
        ("[passes.end]\ninputs = 3", 'passes.end.inputs: wants { port = "pass.port" }'),
        ("[passes.end]\ninputs = {image = 3}", 'passes.end.inputs: wants { port = "pass.port" }'),
        ("[passes.end]\ntype = 'blur'\nradius = 10", "end.radius: is 10, but wants a number at least 0 and at most 9"),
        ("[passes.end]\ntype = 'blur'\nradus = 1", "end.radus: no such parameter; did you mean 'radius'?"),
        ("[passes.end]\ntype = 'blur'\n'rad\\nius' = 1", "no such parameter"),
        ('[passes.end]\ntype = "blur"\n"rad\\nius" = 1', "no such parameter"),
        ('[passes."e\\nd"]', "no pass type"),
        ('"ke\\ny" = 1', "no such key"),
        (f"a = {'[' * 10_000}", "not a TOML file"),
        (f"a = {'9' * 5000}", "not a TOML file"),
    ],
    ids=lambda value: value[:40],
)
def test_each_fault_of_a_file_is_told(tmp_path, text, message):
    assert message in fault(tmp_path, text)


def test_all_faults_of_a_file_are_told_at_once(tmp_path):
    text = "outs = 1\n[passes.a]\ntype = 'blurr'\n[passes.b]\ntype = 'blur'\nradius = -1\nradus = 2\n[passes.c]\n"
    told = fault(tmp_path, text, {"d.radius": 1})
    for part in ("outs: ", "passes.a: ", "b.radius: ", "b.radus: ", "passes.c: ", "outputs: ", "set d.radius: "):
        assert told.count(part) == 1, part


def test_a_file_that_is_no_text(tmp_path):
    (tmp_path / "own.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(GraphError, match=r"own\.toml: not a TOML file"):
        load_graph(tmp_path / "own.toml")


# Settings


def test_settings_are_laid_over_the_file(tmp_path):
    path = write(tmp_path, SMALL + "radius = 2.0\n")
    graph = load_graph(path, {"end.radius": 3, "start.steps": 9}, OWN)
    assert graph.nodes["end"].work.params == Params(radius=3.0)
    assert graph.nodes["start"].work.params == Params(steps=9)


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("radius", 1, "set radius: wants pass.param = value"),
        ("end.", 1, "end.: no such parameter"),
        ("end.type", "blur", "set end.type: wants pass.param = value"),
        ("end.inputs", {}, "set end.inputs: wants pass.param = value"),
        ("ende.radius", 1, "set ende.radius: no pass 'ende' in this graph; did you mean 'end'?"),
        ("end.radus", 1, "end.radus: no such parameter; did you mean 'radius'?"),
        ("end.radius", "wide", "end.radius: is 'wide', but wants a number at least 0 and at most 9"),
        ("end.radius", [1], "end.radius: is [1], but wants a number"),
    ],
)
def test_each_fault_of_a_setting_is_told(tmp_path, key, value, message):
    assert message in fault(tmp_path, SMALL, {key: value})


# Parameters that have moved to another pass

MOVED = """
[passes.middle]
type = "split"
[passes.other]
type = "split"
width = 4.0
"""


@pytest.fixture(autouse=True)
def forget_notes():
    former_names._note.cache_clear()


def widths(graph: Graph) -> list[float]:
    return [graph.nodes[name].work.params.width for name in ("middle", "other")]


@pytest.mark.parametrize("former", ["start.size", "blur.size", "end.size"])
def test_a_setting_under_a_former_name_reaches_all_nodes_that_have_the_parameter_now(tmp_path, caplog, former):
    graph = load_graph(write(tmp_path, SMALL + MOVED), {former: 3}, OWN)
    assert widths(graph) == [3.0, 3.0]
    assert caplog.messages == [f"{former} has moved: write middle.width and other.width"]
    load_graph(write(tmp_path, SMALL + MOVED), {former: 3}, OWN)
    assert len(caplog.messages) == 1


def test_a_former_name_can_be_that_of_a_node(tmp_path, caplog):
    graph = load_graph(write(tmp_path, SMALL + MOVED), {"end.shape": 3}, OWN)
    assert graph.nodes["middle"].work.params.shape == 3
    assert "end.shape has moved: write middle.shape and other.shape" in caplog.messages
    assert "no such parameter" in fault(tmp_path, SMALL + MOVED, {"start.shape": 3})


def test_a_file_may_use_former_names_and_is_laid_over_what_it_extends(tmp_path, caplog):
    write(tmp_path, SMALL + MOVED, "base.toml")
    graph = load_graph(write(tmp_path, 'extends = "base.toml"\n[passes.end]\nsize = 2\nradius = 5\n'), {}, OWN)
    assert widths(graph) == [2.0, 2.0]
    assert graph.nodes["end"].work.params.radius == 5.0
    assert dict(graph.nodes["end"].inputs) == {"image": "start.out"}
    assert "end.size has moved: write middle.width and other.width" in caplog.messages
    graph = load_graph(tmp_path / "own.toml", {"middle.width": 6, "end.radius": 1}, OWN)
    assert widths(graph) == [6.0, 2.0]
    assert load_graph(write(tmp_path, SMALL + "size = 2\n" + MOVED.replace("width = 4.0", ""), "whole.toml"), {}, OWN)


def test_what_extends_a_file_with_former_names_wins_over_them(tmp_path):
    write(tmp_path, SMALL + "size = 2\n" + MOVED.replace("width = 4.0", ""), "base.toml")
    graph = load_graph(write(tmp_path, 'extends = "base.toml"\n[passes.middle]\nwidth = 7\n'), {}, OWN)
    assert widths(graph) == [7.0, 2.0]


def test_values_under_a_former_and_the_present_name_must_agree(tmp_path):
    told = fault(tmp_path, SMALL + MOVED, {"end.size": 3, "other.width": 4})
    assert "set end.size: has moved to other.width, which has another value; remove one" in told
    assert "middle" not in told
    assert widths(load_graph(tmp_path / "own.toml", {"end.size": 3, "other.width": 3}, OWN)) == [3.0, 3.0]
    assert "end.size: has moved to other.width" in fault(tmp_path, SMALL + "size = 2\n" + MOVED)


def test_a_value_under_a_former_name_is_checked(tmp_path):
    assert "middle.width: is 'x', but wants a number" in fault(tmp_path, SMALL + MOVED, {"end.size": "x"})


# Hash


def test_the_hash_changes_with_parameters_wiring_outputs_and_nothing_else(tmp_path):
    def hashed(text: str, **chosen: Any) -> str:
        return graph_hash(load_graph(write(tmp_path, text), {"end.radius": 1.0, **chosen}, OWN))

    plain = hashed(SMALL)
    assert hashed(SMALL) == plain
    assert hashed(f"# comment\n{SMALL}") == plain
    assert hashed(SMALL + "radius = 1\n") == plain
    others = {
        hashed(SMALL, **{"start.steps": 4}),
        hashed(SMALL, **{"end.radius": 1.5}),
        hashed(SMALL.replace('image = "end.out"', 'image = "start.out"')),
        hashed(SMALL.replace('inputs = { image = "start.out" }', "")),
        hashed(SMALL.replace("passes.start", "passes.other").replace("start.out", "other.out")),
    }
    assert len(others | {plain}) == 6
    assert all(len(value) == 16 and int(value, 16) >= 0 for value in others)


# Anything at all

WORDS = st.sampled_from(["extends", "outputs", "passes", "type", "inputs", "end", "blur", "vpl", "radius", "end.out"])
VALUES = st.recursive(
    st.booleans() | st.integers() | st.floats() | WORDS | st.text(st.characters(max_codepoint=0x7E), max_size=6),
    lambda inner: st.lists(inner, max_size=2) | st.dictionaries(WORDS, inner, max_size=3),
    max_leaves=10,
)


@settings(deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.fixed_dictionaries(
        {},
        optional={
            "extends": st.just("deferred") | VALUES,
            "outputs": VALUES,
            "passes": st.dictionaries(WORDS, VALUES, max_size=3) | VALUES,
            "other": VALUES,
        },
    ),
    st.dictionaries(st.sampled_from(["end.radius", "vpl.count", "end"]) | st.text(max_size=5), VALUES, max_size=2),
)
def test_any_file_gives_a_graph_or_one_line(tmp_path, table, chosen):
    path = write(tmp_path, "\n".join(f"{key} = {to_toml(value)}" for key, value in table.items()))
    try:
        graph = load_graph(path, chosen, OWN)
        compile(graph, list(graph.outputs))
    except GraphError as error:
        message = str(error)
    else:
        message = "compiled"
    assert len(message.splitlines()) == 1


FOLDERS = [Path(__file__).resolve().parents[2] / folder for folder in ("passes", "profiling")]
GRAPH_FILES = {path.stem: path for folder in FOLDERS for path in sorted(folder.rglob("*.toml"))}


@pytest.mark.parametrize("name", GRAPH_FILES)
def test_every_graph_file_of_the_package_compiles(name):
    graph = load_graph(GRAPH_FILES[name], passes={**visibility.PASSES, **LIMITS, **tessellation.PASSES})
    assert compile(graph, list(graph.outputs)).steps


@pytest.mark.parametrize("name", graph_names())
def test_what_fills_over_frames_says_that_it_retains_samples(name):
    for node in load_graph(name).nodes.values():
        fills = type(node.work).frames_to_fill is not Pass.frames_to_fill
        assert node.work.retains_samples == fills, node.name
        assert node.work.State is not None or not fills
