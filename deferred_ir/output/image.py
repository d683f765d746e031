"""A rendered image and the files it becomes."""

from __future__ import annotations

import os
import uuid
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from deferred_ir.base.errors import OutputError, did_you_mean

SUFFIXES = (".png", ".npy", ".exr")
LONGEST_NAME = 255


@dataclass(frozen=True, eq=False)
class Image:
    """radiance: float32 (H, W, 3), linear RGB, top row first, or None where it was not asked for.

    display: uint8 (H, W, 3), sRGB, tone-mapped by the graph, or None likewise.
    """

    radiance: Any
    display: Any

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write `.png` (display pixels), `.npy` or `.exr` (float32 radiance); the file appears whole or not at all."""
        path = Path(path)
        check_path(path)
        suffix = path.suffix.lower()
        name = "display" if suffix == ".png" else "radiance"
        pixels = getattr(self, name)
        if pixels is None:
            raise OutputError(
                f"{path}: this graph has no output '{name}', which {suffix} files hold; save another kind"
            )
        write = {".png": _png, ".npy": _npy, ".exr": _exr}[suffix]
        write_whole(path, lambda part: write(part, pixels))


def _png(path: Path, pixels: Any) -> None:
    import PIL.Image

    PIL.Image.fromarray(pixels).save(path, format="PNG")


def _npy(path: Path, pixels: Any) -> None:
    with path.open("wb") as file:
        np.save(file, pixels)


def _exr(path: Path, pixels: Any) -> None:
    import OpenEXR

    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    try:
        with OpenEXR.File(header, {"RGB": np.ascontiguousarray(pixels, np.float32)}) as file:
            file.write(str(path))
    except RuntimeError as error:  # its word for a fault of the system's
        raise OSError(str(error)) from error


def check_path(path: str | os.PathLike[str]) -> None:
    """Raise OutputError if `path` cannot be a result: better before the work than after it."""
    path = Path(path)
    if path.suffix.lower() not in SUFFIXES and not os.path.isdir(path):
        raise OutputError(f"{path}: unknown kind of image '{path.suffix}'{did_you_mean(path.suffix, SUFFIXES)}")
    check_folder(path)


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
