"""Finds the files that a model file names, materials and images, however exporters write the names."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from urllib.parse import unquote

MAP_OPTIONS = re.compile(r"(-[A-Za-z]\w*(\s+(on|off|[-+.\d]+(e[-+]?\d+)?|[rgbmlz]))*\s+)+")


SCHEME = re.compile(r"[A-Za-z][A-Za-z0-9+.-]+:")  # of one letter it would be a drive


class Assets(Mapping[str, bytes]):
    """The files next to a model, by name, and `blobs`, contents in memory by name. A resolver for trimesh.

    Unlike trimesh's own it accepts backslashes and percent escapes, and drops the options that a map of an MTL file may
    have before its name. A name that leads nowhere, or out of the permitted folders, is tried without its folders.
    Nothing is read outside the first of `folders` and `root`.
    """

    def __init__(self, folders: list[Path], blobs: Mapping[str, bytes] | None = None, root: Path | None = None) -> None:
        self.folders = folders
        self.blobs = dict(blobs or {})
        self.roots = [_normalise(folders[0]), *([] if root is None else [_normalise(root)])]

    def path(self, name: str) -> Path | None:
        """Return the file that `name` means, or None if there is none, as for a name with a scheme such as http:."""
        name = strip_options(name).strip().replace("\\", "/")
        if SCHEME.match(name):
            return self._find(name)
        for candidate in (name, unquote(name), name.rsplit("/", 1)[-1], unquote(name).rsplit("/", 1)[-1]):
            if found := self._find(candidate):
                return found
        return None

    def _find(self, name: str) -> Path | None:
        """Return the file of exactly this name in one of the folders, inside the roots."""
        if not name or "\0" in name:
            return None
        for folder in self.folders:
            inside = any(_normalise(folder / name).is_relative_to(root) for root in self.roots)
            # Unlike Path.is_file this does not raise for names that the system cannot have.
            if inside and os.path.isfile(folder / name):
                return folder / name
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


def _normalise(path: Path) -> Path:
    """Return `path` absolute and without `..`; links stay, since whoever made the folder made them."""
    return Path(os.path.abspath(path))


def strip_options(name: str) -> str:
    """Return the file name of an MTL map without the options before it, such as `-s 2 2 1`."""
    return MAP_OPTIONS.sub("", name.strip(), count=1) if name.strip().startswith("-") else name
