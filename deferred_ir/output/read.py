"""Reading back what a render or a reference wrote: linear images, and the JSON record beside them."""

from __future__ import annotations

import io
import json
import os
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from pathlib import Path
from typing import Any

import numpy as np

from deferred_ir.base.arrays import Array
from deferred_ir.base.errors import SettingError, did_you_mean, shown
from deferred_ir.output.image import radiance

SUFFIXES = (".npy", ".exr")


def read_radiance(path: Path) -> Array:
    """The linear radiance in a `.npy` or `.exr`: float64 (H, W, 3), all finite; else a SettingError."""
    if path.suffix.lower() == ".png":
        raise SettingError(f"{path}: is tone-mapped; compare linear radiance, .npy or .exr")
    if path.suffix.lower() not in SUFFIXES:
        raise SettingError(f"{path}: unknown kind of image '{path.suffix}'{did_you_mean(path.suffix, SUFFIXES)}")
    if not os.path.isfile(path):  # unlike Path.is_file it does not raise for names that the system cannot have
        raise SettingError(f"{path}: is {'no file' if os.path.exists(path) else 'missing'}")
    return radiance(_npy(path) if path.suffix.lower() == ".npy" else _exr(path), str(path))


def _npy(path: Path) -> Any:
    try:
        # Mapped, since then a size that the header claims and the file lacks is found before memory is asked for it.
        return np.lib.format.open_memmap(path, mode="r")
    except (OSError, ValueError, EOFError) as error:
        raise SettingError(f"{path}: is no array that can be read: {_line(error)}") from error


def _exr(path: Path) -> Any:
    import OpenEXR

    try:
        with _muted(), OpenEXR.File(str(path), separate_channels=True) as file:
            channels = {name: channel.pixels for name, channel in file.channels().items()}
    except (RuntimeError, ValueError, OSError) as error:
        raise SettingError(f"{path}: is no OpenEXR image that can be read: {_line(error)}") from error
    missing = [name for name in "RGB" if name not in channels]
    if missing:
        raise SettingError(f"{path}: has no channel '{missing[0]}'{did_you_mean(missing[0], channels)}")
    if len({channels[name].shape for name in "RGB"}) > 1:
        raise SettingError(f"{path}: its channels R, G and B differ in size")
    return np.stack([channels[name] for name in "RGB"], axis=-1)


@contextmanager
def _muted() -> Iterator[None]:
    """Without what OpenEXR's own code prints about a broken file: the error that it raises is told anyway.

    Its module prints through sys.stdout, the library below it straight to the process's streams.
    """
    kept = {stream: os.dup(stream) for stream in (1, 2)}
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        for stream in kept:
            os.dup2(nowhere, stream)
        with redirect_stdout(io.StringIO()):
            yield
    finally:
        for stream, copy in kept.items():
            os.dup2(copy, stream)
            os.close(copy)
        os.close(nowhere)


def record_path(path: Path) -> Path:
    """Where the record of an image lies: OUT.json beside OUT.npy."""
    return path.with_suffix(".json")


def read_record(path: Path, size: tuple[int, int]) -> dict[str, Any]:
    """What the record beside the image `path` says of it, or an empty dictionary if there is none that does.

    A JSON file without `scene_hash` is something else of the same name. `size`: (width, height) of the image, which
    the record has to state too, or the two do not belong together.
    """
    file = record_path(path)
    if not os.path.exists(file):
        return {}
    try:
        record = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise SettingError(f"{file}: cannot be read as JSON: {_line(error)}; mend or remove it") from error
    if not isinstance(record, dict) or "scene_hash" not in record:
        return {}
    if not isinstance(record["scene_hash"], str):
        raise SettingError(f"{file}: scene_hash: must be text, not {shown(record['scene_hash'])}")
    if record.get("size") != list(size):
        raise SettingError(
            f"{file}: size: is {shown(record.get('size'))}, but {path.name} is {size[0]}x{size[1]};"
            " the two do not belong together"
        )
    hit = record.get("hit_fraction")
    if hit is not None and (isinstance(hit, bool) or not isinstance(hit, int | float) or not 0 <= hit <= 1):
        raise SettingError(f"{file}: hit_fraction: {shown(hit)} is no number from 0 to 1")
    return record


def _line(error: Exception) -> str:
    text = error.strerror if isinstance(error, OSError) else None
    return " ".join((text or str(error)).split()) or type(error).__name__
