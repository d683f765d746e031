"""What frames cost on a machine: kept in the cache folder, and predicted between the sizes that were measured."""

import logging
from itertools import pairwise

import pytest

from deferred_ir.graph.file import load_graph
from deferred_ir.tuning import machine_costs
from deferred_ir.tuning.ladder import GRAPH, RUNGS, VPLS, list_rungs
from deferred_ir.tuning.machine_costs import SIZES, MachineCosts

MS = [[10.0 + number, 50.0 + number] for number in range(len(RUNGS))]


@pytest.fixture
def cache(tmp_path, monkeypatch):
    """A cache folder of the test's own."""
    monkeypatch.setattr("platformdirs.user_cache_dir", lambda *_, **__: str(tmp_path / "cache"))
    return tmp_path / "cache"


def test_costs_are_kept_for_this_machine_alone(cache):
    assert machine_costs.read("mine") is None
    machine_costs.keep("mine", MS)
    assert machine_costs.read("mine").ms == MS
    assert machine_costs.read("another") is None
    assert [path.name for path in cache.iterdir()] == [machine_costs.find_file("mine").name]


@pytest.mark.parametrize("text", ["", "{}", "[1]", '{"machine": "mine", "ms": [[1]], "measured": "today"}', "\x00"])
def test_a_damaged_file_is_no_file(cache, text):
    machine_costs.keep("mine", MS)
    machine_costs.find_file("mine").write_text(text)
    assert machine_costs.read("mine") is None


def test_a_folder_that_cannot_be_written_is_a_note(cache, caplog):
    cache.write_text("a file where the folder should be")
    with caplog.at_level(logging.WARNING):
        assert machine_costs.keep("mine", MS).ms == MS
    assert "the costs of this machine cannot be kept" in caplog.text


def test_a_frame_costs_in_proportion_to_its_pixels_beside_a_fixed_part():
    costs = MachineCosts("mine", [[10.0, 50.0], [20.0, 20.0], [30.0, 10.0]], "today")
    few, many = (side**2 for side in SIZES)
    assert costs.predict(0, few) == pytest.approx(10.0)
    assert costs.predict(0, many) == pytest.approx(50.0)
    assert costs.predict(0, 2 * many - few) == pytest.approx(90.0)
    assert costs.predict(0, 1) > 0
    assert costs.predict(1, 10 * many) == pytest.approx(20.0)
    assert costs.predict(2, many) == pytest.approx(30.0), "a measurement that a busy machine disturbed"


# The ladder


def test_every_rung_is_one_that_the_graph_takes_and_no_two_are_alike():
    plans = {repr(sorted(set.items())) for set in RUNGS}
    assert len(plans) == len(RUNGS)
    for set in RUNGS:
        load_graph(GRAPH, set)


def test_what_is_given_is_kept_and_rungs_that_become_alike_are_one():
    graph = load_graph(GRAPH)
    kept = {"sample_pixels.scale": 2, "vpl.count": 16}
    rungs = list_rungs(GRAPH, graph, kept)
    assert 1 < len(rungs) <= len(RUNGS)
    assert all(rung.set.items() >= kept.items() for rung in rungs)
    assert all(one.set != other.set for one, other in pairwise(rungs))


def test_other_graphs_choose_a_number_of_vpls_unless_it_is_given():
    graph = load_graph("deferred")
    assert [rung.set["vpl.count"] for rung in list_rungs("deferred", graph, {})] == list(VPLS)
    assert [rung.set for rung in list_rungs("deferred", graph, {"vpl.count": 5})] == [{"vpl.count": 5}]
