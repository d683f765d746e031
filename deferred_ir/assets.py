"""Files that a model file names: materials and images, found the way exporters write their names."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from urllib.parse import unquote

MAP_OPTIONS = re.compile(r"(-[A-Za-z]\w*(\s+(on|off|[-+.\d]+(e[-+]?\d+)?|[rgbmlz]))*\s+)+")


class Assets(Mapping[str, bytes]):
    """The files next to a model, by name, and `blobs` that are held in memory under names of their own.

    trimesh takes it as a resolver. Unlike trimesh's own it undoes backslashes and percent signs, and drops the options
    that a map of an MTL file may have before its name. A name that leads nowhere is tried without its folders.
    """

    def __init__(self, folders: list[Path], blobs: Mapping[str, bytes] | None = None) -> None:
        self.folders = folders
        self.blobs = dict(blobs or {})

    def path(self, name: str) -> Path | None:
        """The file that `name` means, if there is one."""
        name = without_options(name).strip().replace("\\", "/")
        for candidate in (name, unquote(name), name.rsplit("/", 1)[-1], unquote(name).rsplit("/", 1)[-1]):
            for folder in self.folders:
                if candidate and (folder / candidate).is_file():
                    return folder / candidate
        return None

    def __getitem__(self, name: str) -> bytes:
        if name in self.blobs:
            return self.blobs[name]
        path = self.path(name)
        if path is None:
            raise FileNotFoundError(f"{name} is missing")
        return path.read_bytes()

    def __iter__(self) -> Iterator[str]:
        return iter(self.blobs)

    def __len__(self) -> int:
        return len(self.blobs)


def without_options(name: str) -> str:
    """The file name of an MTL map without the options before it, such as `-s 2 2 1`."""
    return MAP_OPTIONS.sub("", name.strip(), count=1) if name.strip().startswith("-") else name
