"""A rendered image and the files it becomes."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from deferred_ir.base.arrays import Array
from deferred_ir.base.errors import OutputError, SettingError, did_you_mean
from deferred_ir.base.files import check_folder, write_whole

LARGEST = float(np.finfo(np.float32).max)
SUFFIXES = (".png", ".npy", ".exr")


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


def radiance(image: Any, name: str = "image") -> Array:
    """`image` in double precision, or a SettingError if it is no (H, W, 3) array of finite 32-bit floats.

    What is not finite is counted in pixels. Infinity in 32 bits counts as infinity: radiance is stored so.
    """
    array = np.asarray(image)
    if array.dtype.kind != "f":
        raise SettingError(f"{name}: holds {array.dtype}; wants linear radiance in floats")
    if array.ndim != 3 or array.shape[2] != 3 or array.size == 0:
        raise SettingError(f"{name}: has the shape {array.shape}; wants (height, width, 3)")
    with np.errstate(over="ignore", invalid="ignore"):
        double = array.astype(np.float64)
    bad = ~(np.abs(double) <= LARGEST).all(-1)
    if bad.any():
        y, x = np.argwhere(bad)[0]
        which = f"{bad.sum()} of {bad.size} pixels are"
        raise SettingError(f"{name}: {which} not finite, first x = {x}, y = {y} from the top left; nothing is averaged")
    return double
