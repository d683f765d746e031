"""Values of options that several commands take."""

from __future__ import annotations

import argparse

import pytest

from deferred_ir.cli.options import parse_duration


@pytest.mark.parametrize(
    ("text", "seconds"), [("200ms", 0.2), ("0.2s", 0.2), ("0.2", 0.2), ("1e3ms", 1.0), (".5 s", 0.5)]
)
def test_a_duration_is_of_seconds_or_milliseconds(text, seconds):
    assert parse_duration(text) == pytest.approx(seconds)


@pytest.mark.parametrize(
    "text", ["", "ms", "s", "0", "-1s", "0ms", "nan", "infs", "1e99", "2min", "soon", "1sms", "0.2 S"]
)
def test_what_is_no_duration_is_refused_with_an_example(text):
    with pytest.raises(argparse.ArgumentTypeError, match=r"is no duration, such as 200ms or 0\.2s"):
        parse_duration(text)
