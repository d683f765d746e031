"""Parameters: what is accepted, what is told of the rest, and that nothing else is ever raised."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal

import pytest
from hypothesis import given
from hypothesis import strategies as st

from deferred_ir.graph.params import NoParams, param, parse, read_value, specs


@dataclass(frozen=True)
class Params:
    on: bool = param(False, doc="A switch.")
    count: int = param(4, lo=1, hi=8, doc="A count.")
    least: int = param(0, lo=0, doc="A count without an end.")
    free: float = param(0.0, doc="Any number.")
    scale: float = param(1.0, lo=0.0, hi=2.0, doc="A factor.")
    mode: Literal["soft", "hard"] = param("soft", doc="A choice.")
    exposure: float | Literal["auto"] = param("auto", lo=-4.0, hi=4.0, doc="A number or a word.")
    size: int | Literal["auto", "none"] = param("auto", lo=1, doc="A whole number or a word.")


def parsed(**table: Any) -> tuple[Any, list[str]]:
    faults: list[str] = []
    return parse(Params, table, "pass", faults), faults


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("on", True),
        ("on", False),
        ("count", 1),
        ("count", 8),
        ("least", 10**12),
        ("free", -1e300),
        ("scale", 0.0),
        ("scale", 2.0),
        ("mode", "hard"),
        ("exposure", "auto"),
        ("exposure", -4.0),
        ("size", "none"),
        ("size", 512),
    ],
)
def test_values_of_the_type_and_in_range_are_taken(name, value):
    result, faults = parsed(**{name: value})
    assert not faults
    assert getattr(result, name) == value
    assert type(getattr(result, name)) is type(value)


def test_a_whole_number_becomes_a_float_where_one_is_wanted():
    result, faults = parsed(scale=2, exposure=-1)
    assert not faults
    assert (type(result.scale), type(result.exposure)) == (float, float)


@pytest.mark.parametrize(
    ("name", "value", "wants"),
    [
        ("on", 1, "true or false"),
        ("on", "true", "true or false"),
        ("count", 0, "a whole number at least 1 and at most 8"),
        ("count", 9, "a whole number at least 1 and at most 8"),
        ("count", 4.0, "a whole number"),
        ("count", True, "a whole number"),
        ("count", "4", "a whole number"),
        ("count", [4], "a whole number"),
        ("least", -1, "a whole number at least 0"),
        ("free", math.nan, "a number"),
        ("free", math.inf, "a number"),
        ("free", True, "a number"),
        ("free", "much", "a number"),
        ("scale", -0.001, "a number at least 0 and at most 2"),
        ("scale", math.nan, "a number at least 0 and at most 2"),
        ("mode", "firm", "'soft', 'hard'"),
        ("mode", 1, "'soft', 'hard'"),
        ("mode", False, "'soft', 'hard'"),
        ("exposure", "automatic", "'auto' or a number at least -4 and at most 4"),
        ("exposure", 5.0, "'auto' or a number at least -4 and at most 4"),
        ("size", 1.5, "'auto', 'none' or a whole number at least 1"),
        ("size", {"auto": 1}, "'auto', 'none' or a whole number at least 1"),
    ],
)
def test_any_other_value_is_told_with_what_is_wanted_and_the_default_stays(name, value, wants):
    result, faults = parsed(**{name: value})
    assert len(faults) == 1
    assert faults[0].startswith(f"pass.{name}: is ")
    assert wants in faults[0]
    assert result == Params()


@pytest.mark.parametrize(("name", "word"), [("mode", "sofd"), ("mode", "Hard")])
def test_a_misspelt_word_is_guessed(name, word):
    _, faults = parsed(**{name: word})
    assert "did you mean '" in faults[0]


def test_a_misspelt_name_is_guessed_and_a_strange_one_gets_the_list():
    _, faults = parsed(exposur=1.0)
    assert faults == ["pass.exposur: no such parameter; did you mean 'exposure'?"]
    _, faults = parsed(zzz=1)
    assert faults[0].endswith("known: count, exposure, free, least, mode, on, scale, size")


def test_a_pass_without_parameters_takes_none():
    faults: list[str] = []
    assert parse(NoParams, {"size": 1}, "pass", faults) == NoParams()
    assert faults == ["pass.size: no such parameter"]


def test_all_faults_are_told_at_once_and_the_rest_is_kept():
    result, faults = parsed(count=0, mode="firm", sise=1, scale=0.5)
    assert [fault.partition(":")[0] for fault in faults] == ["pass.count", "pass.mode", "pass.sise"]
    assert result == Params(scale=0.5)


def test_specs_hold_what_a_widget_needs():
    known = specs(Params)
    assert list(known) == ["on", "count", "least", "free", "scale", "mode", "exposure", "size"]
    count, exposure = known["count"], known["exposure"]
    assert (count.default, count.doc, count.number, count.choices) == (4, "A count.", int, ())
    assert (count.lo, count.hi) == (1, 8)
    assert (exposure.default, exposure.number, exposure.choices) == ("auto", float, ("auto",))
    assert (known["mode"].number, known["mode"].choices) == (None, ("soft", "hard"))


HUGE = 0x1 << 20_000
"""More digits than Python writes, and beyond floats: a hexadecimal number in a file can be that long."""


@pytest.mark.parametrize("name", list(specs(Params)))
@pytest.mark.parametrize("value", [HUGE, -HUGE, 10**400], ids=["huge", "-huge", "10^400"])
def test_a_number_beyond_floats_is_a_fault_or_a_whole_number(name, value):
    result, faults = parsed(**{name: value})
    assert faults or getattr(result, name) == value
    assert all(len(fault) < 200 for fault in faults)


VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.just(10**400) | st.floats() | st.text() | st.dates(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner, max_size=3),
    max_leaves=5,
)


@given(st.dictionaries(st.sampled_from(list(specs(Params))) | st.text(), VALUES, max_size=4))
def test_any_table_is_taken_or_told(table):
    faults: list[str] = []
    result = parse(Params, table, "pass", faults)
    assert isinstance(result, Params)
    assert len(faults) <= len(table)
    again: list[str] = []
    for name, spec in specs(Params).items():
        assert spec.fault(getattr(result, name)) is None
        if name in table and not any(fault.startswith(f"pass.{name}:") for fault in faults):
            exact = spec.number is not float or isinstance(table[name], str)
            assert getattr(result, name) == (table[name] if exact else float(table[name]))
    assert parse(Params, vars(result), "pass", again) == result
    assert not again


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("512", 512),
        ("0x10", 16),
        ("-1.5", -1.5),
        ("1e3", 1000.0),
        ("true", True),
        ("false", False),
        ('"quoted words"', "quoted words"),
        ("auto", "auto"),
        ("True", "True"),
        ("", ""),
        ("two words", "two words"),
        ("[1, 2]", [1, 2]),
        ("= 3", "= 3"),
        ("1\nother = 2", "1\nother = 2"),
        ("9" * 5000, "9" * 5000),
        ("[" * 100_000, "[" * 100_000),
    ],
    ids=lambda value: str(value)[:20],
)
def test_a_setting_is_a_toml_value_or_the_bare_word(text, value):
    result = read_value(text)
    assert result == value
    assert type(result) is type(value)


@given(st.text())
def test_any_setting_can_be_read(text):
    read_value(text)
