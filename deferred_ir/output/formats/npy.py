"""`.npy`: linear radiance as a NumPy array."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from deferred_ir.base.errors import summarise

LAYER = "radiance"


def write(path: Path, pixels: Any) -> None:
    """Write an array."""
    with path.open("wb") as file:
        np.save(file, pixels)


def read(path: Path) -> Any:
    """Read an array. Raises ValueError, which says what is wrong."""
    try:
        # Mapped, since then a size that the header claims and the file lacks is found before memory is asked for it.
        return np.lib.format.open_memmap(path, mode="r")
    except (OSError, ValueError, EOFError) as error:
        raise ValueError(f"is no array that can be read: {summarise(error)}") from error
