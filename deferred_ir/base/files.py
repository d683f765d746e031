"""Writes files whole or not at all, and checks beforehand that they can be written."""

from __future__ import annotations

import json
import os
import uuid
from collections.abc import Callable
from pathlib import Path
from typing import Any

from deferred_ir.base.errors import OutputError

LONGEST_NAME = 255


def check_folder(path: Path) -> None:
    """Raise OutputError if no file can be written at `path`."""
    folder = path.parent
    if os.path.isdir(path):  # unlike Path.is_dir it does not raise for names that the system cannot have
        raise OutputError(f"{path}: is a folder; name a file in it")
    if not os.path.isdir(folder):
        raise OutputError(f"{path}: there is no folder '{folder}'; create it first")
    if not os.access(folder, os.W_OK):
        raise OutputError(f"{path}: the folder '{folder}' is not writable; choose another")
    if len(os.fsencode(path.name)) > LONGEST_NAME:
        raise OutputError(f"{path.name[:40]}...: is too long for a file's name; {LONGEST_NAME} bytes are the most")


def write_whole(path: Path, write: Callable[[Path], None]) -> None:
    """Let `write` fill a file beside `path`, then put it in place at once."""
    part = path.with_name(f".{uuid.uuid4().hex}.part")
    try:
        write(part)
        os.replace(part, path)
    except OSError as error:
        raise OutputError(f"{path}: cannot be written: {error.strerror or error}") from error
    finally:
        part.unlink(missing_ok=True)


def write_json(path: Path, data: dict[str, Any]) -> None:
    """Write JSON whole or not at all."""
    text = json.dumps(data, indent=1, allow_nan=False) + "\n"

    def fill(part: Path) -> None:
        part.write_text(text, encoding="utf-8")

    write_whole(path, fill)
