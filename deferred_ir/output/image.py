"""A rendered image, and linear radiance read back from a file."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from deferred_ir.base.arrays import Array
from deferred_ir.base.errors import OutputError, SettingError, did_you_mean
from deferred_ir.base.files import write_whole
from deferred_ir.output.find_format import check_path, find_format, list_suffixes

LARGEST = float(np.finfo(np.float32).max)


@dataclass(frozen=True, eq=False)
class Image:
    """radiance: float32 (H, W, 3), linear RGB, top row first, or None where it was not asked for.

    display: uint8 (H, W, 3), sRGB, tone-mapped by the graph, or None likewise. frames: how many it is the mean of.
    error_estimate: the relMSE to be expected of it, None for a single frame.
    """

    radiance: Any
    display: Any
    frames: int = 1
    error_estimate: float | None = None

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write `.png` (display pixels), `.npy` or `.exr` (float32 radiance); the file appears whole or not at all."""
        path = Path(path)
        check_path(path)
        kind = find_format(path)
        pixels = getattr(self, kind.LAYER)
        if pixels is None:
            suffix = path.suffix.lower()
            raise OutputError(
                f"{path}: this graph has no output '{kind.LAYER}', which {suffix} files hold; save another kind"
            )
        write_whole(path, lambda part: kind.write(part, pixels))


def read_radiance(path: Path) -> Array:
    """Read linear radiance from an image file: float64 (H, W, 3), all finite. Raises SettingError."""
    linear = list_suffixes("radiance")
    if path.suffix.lower() not in list_suffixes():
        raise SettingError(f"{path}: unknown kind of image '{path.suffix}'{did_you_mean(path.suffix, linear)}")
    kind = find_format(path)
    if kind.LAYER != "radiance":
        raise SettingError(f"{path}: is tone-mapped; compare linear radiance, {' or '.join(linear)}")
    if not os.path.isfile(path):  # unlike Path.is_file it does not raise for names that the system cannot have
        raise SettingError(f"{path}: is {'no file' if os.path.exists(path) else 'missing'}")
    try:
        pixels = kind.read(path)
    except ValueError as error:
        raise SettingError(f"{path}: {error}") from error
    return check_radiance(pixels, str(path))


def check_radiance(image: Any, name: str = "image") -> Array:
    """Return `image` in double precision. Raises SettingError unless it is (H, W, 3) of finite 32-bit floats.

    The error counts the pixels that are not finite. Infinity in 32 bits counts as infinity: radiance is stored so.
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
