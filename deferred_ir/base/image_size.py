"""Image sizes as users write them, such as 512x512."""

from __future__ import annotations

import re

SIZE = re.compile(r"\s*(\d{1,9})\s*[xX]\s*(\d{1,9})\s*")


def parse_size(text: str) -> tuple[int, int] | None:
    """Return (width, height) of a string such as "512x512", or None where it is no size or a side is 0."""
    match = SIZE.fullmatch(text)
    if match is None or not (int(match[1]) and int(match[2])):
        return None
    return int(match[1]), int(match[2])
