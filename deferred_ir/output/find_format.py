"""Find the kind of image a file name means, and whether it can be written. Imports no format that is not asked for."""

from __future__ import annotations

import importlib
import os
import pkgutil
from pathlib import Path
from typing import Any, Protocol, cast

from deferred_ir.base.errors import OutputError, did_you_mean
from deferred_ir.base.files import check_folder
from deferred_ir.output import formats


class Format(Protocol):
    """A module of output/formats; its name is the suffix of the files that it reads and writes.

    LAYER: the field of Image that they hold, and the output of a graph that they need.
    """

    LAYER: str

    def write(self, path: Path, pixels: Any, /) -> None:
        """Write the layer. Raises OSError if the system refuses."""

    def read(self, path: Path, /) -> Any:
        """Read the layer, an array (H, W, 3). Raises ValueError, which says what is wrong with the file."""


def list_suffixes(layer: str | None = None) -> list[str]:
    """Return the suffixes of all formats, with their dots, or of those that hold `layer`."""
    names = sorted(module.name for module in pkgutil.iter_modules(formats.__path__))
    return [f".{name}" for name in names if layer is None or layer == _load(name).LAYER]


def find_format(path: Path) -> Format:
    """Return the format that the suffix of `path` means, in capitals or not. Raises OutputError for any other."""
    suffix, known = path.suffix.lower(), list_suffixes()
    if suffix not in known:
        raise OutputError(f"{path}: unknown kind of image '{path.suffix}'{did_you_mean(path.suffix, known)}")
    return _load(suffix[1:])


def check_path(path: str | os.PathLike[str]) -> None:
    """Raise OutputError if no image can be written at `path`: better before the work than after it."""
    path = Path(path)
    if not os.path.isdir(path):
        find_format(path)
    check_folder(path)


def _load(name: str) -> Format:
    return cast(Format, importlib.import_module(f"{formats.__name__}.{name}"))
