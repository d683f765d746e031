"""Values as TOML text, for files that tests make up."""

from __future__ import annotations

import json


def toml(value: object) -> str:
    """A value as inline TOML: JSON, but for floats, tables and dates (for None)."""
    match value:
        case None:
            text = "1979-05-27"
        case list():
            text = f"[{', '.join(toml(item) for item in value)}]"
        case dict():
            text = f"{{{', '.join(f'{toml(key)} = {toml(item)}' for key, item in value.items())}}}"
        case float():
            text = repr(value)
        case _:
            text = json.dumps(value).replace("\x7f", "\\u007f")
    return text
