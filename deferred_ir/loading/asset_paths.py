"""Files that a model file names: materials and images, found the way exporters write their names."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from urllib.parse import unquote

MAP_OPTIONS = re.compile(r"(-[A-Za-z]\w*(\s+(on|off|[-+.\d]+(e[-+]?\d+)?|[rgbmlz]))*\s+)+")


SCHEME = re.compile(r"[A-Za-z][A-Za-z0-9+.-]+:")  # of one letter it would be a drive


class Assets(Mapping[str, bytes]):
    """The files next to a model, by name, and `blobs` that are held in memory under names of their own.

    trimesh takes it as a resolver. Unlike trimesh's own it undoes backslashes and percent signs, and drops the options
    that a map of an MTL file may have before its name. A name that leads nowhere, or out of `root`, is tried without
    its folders. root: the folder that nothing is read outside of; the first of `folders` unless given.
    """

    def __init__(self, folders: list[Path], blobs: Mapping[str, bytes] | None = None, root: Path | None = None) -> None:
        self.folders = folders
        self.blobs = dict(blobs or {})
        self.roots = [_plain(folders[0]), *([] if root is None else [_plain(root)])]

    def path(self, name: str) -> Path | None:
        """The file that `name` means, if there is one; a name with a scheme, such as http:, means none."""
        name = without_options(name).strip().replace("\\", "/")
        if SCHEME.match(name):
            return self._file(name)
        for candidate in (name, unquote(name), name.rsplit("/", 1)[-1], unquote(name).rsplit("/", 1)[-1]):
            if found := self._file(candidate):
                return found
        return None

    def _file(self, name: str) -> Path | None:
        """The file of this very name in one of the folders, not outside the roots."""
        if not name or "\0" in name:
            return None
        for folder in self.folders:
            inside = any(_plain(folder / name).is_relative_to(root) for root in self.roots)
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


def _plain(path: Path) -> Path:
    """`path` absolute and without `..`; links stay, since whoever made the folder made them."""
    return Path(os.path.abspath(path))


def without_options(name: str) -> str:
    """The file name of an MTL map without the options before it, such as `-s 2 2 1`."""
    return MAP_OPTIONS.sub("", name.strip(), count=1) if name.strip().startswith("-") else name
