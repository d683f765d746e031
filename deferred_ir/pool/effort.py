"""How much each sample does for its light: the more VPLs are asked for the more, but no faster than their logarithm.

The pool grows with the number of VPLs, and with it what can be known of the light; a sample that always asked the same
few of them would not gain by it.
"""

from __future__ import annotations

from collections.abc import Mapping

from deferred_ir.graph.ports import Buffer, Description, Input, Output

LEAST = 6
"""Logarithm to base 2 of the most VPLs for which samples do no more than their parameters say."""
MOST = 4


def find_effort(count: int) -> int:
    """Return the effort for `count` VPLs: the largest power of two up to log2(count) - 5, from 1 to 4.

    1 up to 127 VPLs, 2 up to 511, and then 4.
    """
    steps = max(count.bit_length() - LEAST, 1)
    return min(1 << steps.bit_length() - 1, MOST)


def describe_effort(count: int) -> Output:
    """Return the port of the effort for `count` VPLs; it has no contents."""
    return Output("factor on what samples do, for the number of VPLs", Buffer("effort", find_effort(count), 4))


def accept_effort(doc: str) -> Input:
    """Return an input for the effort; doc: what it multiplies."""
    return Input(doc, format="effort", optional=True)


def read_effort(inputs: Mapping[str, Description | None]) -> int:
    """Return the effort that is connected to the input `effort`, 1 where none is."""
    found = inputs["effort"]
    return found.records if isinstance(found, Buffer) else 1
