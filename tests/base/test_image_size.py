"""Sizes as users write them."""

from __future__ import annotations

import pytest

from deferred_ir.base.image_size import parse_size


@pytest.mark.parametrize(
    ("text", "size"), [("64x32", (64, 32)), (" 8 X 9 ", (8, 9)), ("8", None), ("0x1", None), ("-1x1", None)]
)
def test_parse_size(text: str, size: tuple[int, int] | None) -> None:
    assert parse_size(text) == size
