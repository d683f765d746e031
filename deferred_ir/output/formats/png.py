"""`.png`: display pixels, 8 bits sRGB."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

LAYER = "display"


def write(path: Path, pixels: Any) -> None:
    """Write uint8 (H, W, 3)."""
    import PIL.Image

    PIL.Image.fromarray(pixels).save(path, format="PNG")


def read(path: Path) -> Any:
    """Read uint8 (H, W, 3). Raises OSError or ValueError, which say what is wrong."""
    import PIL.Image

    with PIL.Image.open(path, formats=["PNG"]) as image:
        return np.asarray(image.convert("RGB"))
