"""The effort grows with the number of VPLs, no faster than its logarithm."""

from math import log2

import pytest
from hypothesis import given
from hypothesis import strategies as st

from deferred_ir.pool.effort import MOST, describe_effort, find_effort, read_effort


@pytest.mark.parametrize(
    ("count", "effort"), [(0, 1), (1, 1), (64, 1), (127, 1), (128, 2), (511, 2), (512, 4), (1024, 4), (65536, 4)]
)
def test_steps_stand_where_the_docs_say(count, effort):
    assert find_effort(count) == effort


@given(st.integers(0, 1 << 20), st.integers(0, 1 << 20))
def test_it_grows_but_no_faster_than_the_logarithm(one, other):
    less, more = sorted((one, other))
    assert 1 <= find_effort(less) <= find_effort(more) <= MOST
    assert find_effort(more) <= max(log2(max(more, 1)) - 5, 1)


def test_without_a_wire_it_is_one():
    assert read_effort({"effort": None}) == 1
    assert read_effort({"effort": describe_effort(256).description}) == 2
