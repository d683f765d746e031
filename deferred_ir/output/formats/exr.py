"""`.exr`: linear radiance as OpenEXR, 32-bit floats in the channels R, G and B."""

from __future__ import annotations

import io
import os
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from pathlib import Path
from typing import Any

import numpy as np

from deferred_ir.base.errors import did_you_mean, summarise

LAYER = "radiance"


def write(path: Path, pixels: Any) -> None:
    """Write float32 (H, W, 3)."""
    import OpenEXR

    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    try:
        with OpenEXR.File(header, {"RGB": np.ascontiguousarray(pixels, np.float32)}) as file:
            file.write(str(path))
    except RuntimeError as error:  # OpenEXR raises it for faults of the system, too
        raise OSError(str(error)) from error


def read(path: Path) -> Any:
    """Read the channels R, G and B of any type as (H, W, 3). Raises ValueError, which says what is wrong."""
    import OpenEXR

    try:
        with _silence(), OpenEXR.File(str(path), separate_channels=True) as file:
            channels = {name: channel.pixels for name, channel in file.channels().items()}
    except (RuntimeError, ValueError, OSError) as error:
        raise ValueError(f"is no OpenEXR image that can be read: {summarise(error)}") from error
    missing = [name for name in "RGB" if name not in channels]
    if missing:
        raise ValueError(f"has no channel '{missing[0]}'{did_you_mean(missing[0], channels)}")
    if len({channels[name].shape for name in "RGB"}) > 1:
        raise ValueError("its channels R, G and B differ in size")
    return np.stack([channels[name] for name in "RGB"], axis=-1)


@contextmanager
def _silence() -> Iterator[None]:
    """Suppress what OpenEXR prints about a broken file: the error that it raises says the same.

    Its module prints through sys.stdout, the library below it straight to the process's streams.
    """
    copies = {stream: os.dup(stream) for stream in (1, 2)}
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        for stream in copies:
            os.dup2(nowhere, stream)
        with redirect_stdout(io.StringIO()):
            yield
    finally:
        for stream, copy in copies.items():
            os.dup2(copy, stream)
            os.close(copy)
        os.close(nowhere)
