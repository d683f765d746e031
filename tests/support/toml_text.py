"""Writing values as TOML, for tests that generate files."""

from __future__ import annotations

import json


def to_toml(value: object) -> str:
    """Return a value as inline TOML: JSON but for floats, tables and None, which becomes a date."""
    match value:
        case None:
            text = "1979-05-27"
        case list():
            text = f"[{', '.join(to_toml(item) for item in value)}]"
        case dict():
            text = f"{{{', '.join(f'{to_toml(key)} = {to_toml(item)}' for key, item in value.items())}}}"
        case float():
            text = repr(value)
        case _:
            text = json.dumps(value).replace("\x7f", "\\u007f")
    return text
