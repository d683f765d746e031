"""Trials of compute shaders are kept in the cache folder, and believed only where bits were equal."""

import pytest

from deferred_ir.tuning import stage_costs
from deferred_ir.tuning.stage_costs import Trial

TRIALS = {
    "faster": Trial(2.0, 1.0, equal=True),
    "hardly faster": Trial(1.0, 0.95, equal=True),
    "other": Trial(2.0, 1.0, equal=False),
}


@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch):
    """A cache folder of the test's own."""
    monkeypatch.setattr("platformdirs.user_cache_dir", lambda *_, **__: str(tmp_path / "cache"))


def test_trials_are_kept_for_this_machine_alone():
    assert stage_costs.read("mine") is None
    stage_costs.keep("mine", TRIALS)
    assert stage_costs.read("mine").passes == TRIALS
    assert stage_costs.read("another") is None


def test_only_what_is_faster_and_gives_the_same_bits_is_computed():
    assert stage_costs.list_computed("mine") == frozenset()
    stage_costs.keep("mine", TRIALS)
    assert stage_costs.list_computed("mine") == {"faster"}


@pytest.mark.parametrize(
    "text",
    [
        *("", "{}", "[1]", "\x00", '{"machine": "mine", "passes": [], "measured": "today"}'),
        '{"machine": "mine", "passes": {"faster": {"fragment_ms": 2}}, "measured": "today"}',
        '{"machine": "mine", "passes": {"faster": 1}, "measured": "today"}',
        '{"machine": "other", "passes": {}, "measured": "today"}',
    ],
)
def test_a_damaged_file_is_no_file(text):
    stage_costs.keep("mine", TRIALS)
    stage_costs.find_file("mine").write_text(text)
    assert stage_costs.read("mine") is None
    assert stage_costs.list_computed("mine") == frozenset()


def test_a_trial_says_what_came_of_it():
    assert [str(trial) for trial in TRIALS.values()] == [
        "2.00 ms, computed 1.00 ms, used",
        "1.00 ms, computed 0.95 ms, not faster",
        "2.00 ms, computed 1.00 ms, other pixels",
    ]
