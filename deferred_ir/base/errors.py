"""The errors that deferred-ir raises on purpose.

    Error
    |-- SceneError      a scene file, model, texture or material
    |-- GraphError      a graph file, pass, port or parameter; lists all faults at once
    |-- SettingError    an option of a call or of the command line
    |-- DeviceError     no OpenGL, too little of it, or a refused allocation
    |-- ShaderError     GLSL that does not compile or link
    `-- OutputError     a result that cannot be written

Each message is one line: the file, the key, what is wrong and how to mend it.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from typing import Any


class Error(Exception):
    """Base of all errors of this package."""


class SceneError(Error):
    """A scene, or a file it names, cannot be used."""


class GraphError(Error):
    """A render graph cannot be read or compiled."""


class SettingError(Error):
    """An option has a value that cannot be used."""


class DeviceError(Error):
    """OpenGL is missing, too old, or refused an allocation."""


class ShaderError(Error):
    """A shader does not compile or link."""


class OutputError(Error):
    """A result cannot be written."""


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """Return `; did you mean 'x'?` for the nearest of `known`, else `; known: a, b, c`."""
    names = sorted(known)
    close = difflib.get_close_matches(word, names, n=1, cutoff=0.6)
    if close:
        return f"; did you mean '{close[0]}'?"
    return f"; known: {', '.join(names)}" if names else ""


def format_value(value: Any) -> str:
    """Format a value for an error message: on one line, and shortened if it is long."""
    try:
        text = repr(value)
    except ValueError:  # Python writes no integers of more than 4300 digits
        return "a number of too many digits"
    return text if len(text) <= 40 else f"{text[:37]}..."


def summarise(error: Exception) -> str:
    """Return what an exception of another library says, on one line; its type if it says nothing."""
    text = error.strerror if isinstance(error, OSError) else None
    return " ".join((text or str(error)).split()) or type(error).__name__
