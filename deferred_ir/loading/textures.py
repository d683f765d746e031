"""Decodes image textures with PIL."""

from __future__ import annotations

from typing import Any

import numpy as np

from deferred_ir.base.errors import SceneError
from deferred_ir.scene.surfaces.materials import Texture

IMAGE_FORMATS = (
    "PNG",
    "JPEG",
    "MPO",
    "BMP",
    "TGA",
    "GIF",
    "TIFF",
    "WEBP",
    "PPM",
    "DDS",
    "JPEG2000",
    "ICO",
    "PCX",
    "SGI",
)
"""Formats that are read, by PIL's names. Not EPS and the like, for which PIL runs other programs."""
LARGEST_IMAGE = 1 << 26
"""Most pixels of an image, 8192x8192: a few hundred bytes can declare any number."""


def decode_texture(image: Any, name: str, notes: list[str]) -> Texture:
    """Decode a PIL image of one of IMAGE_FORMATS to 8-bit RGB, with a note on transparency, which is ignored.

    Raises SceneError where the file is broken, too large or of another format.
    """
    if image.format is not None and image.format not in IMAGE_FORMATS:
        raise SceneError(f"{name}: images of format {image.format} are not read; save it as PNG or JPEG")
    width, height = image.size
    if width * height > LARGEST_IMAGE:
        raise SceneError(f"{name}: {width}x{height} pixels, and {LARGEST_IMAGE} are the most; scale it down")
    try:
        image.load()
        pixels = _to_rgb(image)
    except Exception as error:  # PIL's decoders raise many kinds; each means that the file is broken
        raise SceneError(f"{name}: not a readable image ({' '.join(str(error).split())}); replace the file") from error
    if "A" in image.getbands() or "transparency" in image.info:
        notes.append(f"{name}: transparency is ignored")
    return Texture(name, pixels)


def _to_rgb(image: Any) -> Any:
    """Return the pixels of a PIL image, uint8 (H, W, 3)."""
    if image.mode.startswith("I") or image.mode == "F":
        # PIL would clip these to 255; 16 bits are what PNG and TIFF store in them, floats run to 1.
        values = np.asarray(image, dtype=np.float64) / (1.0 if image.mode == "F" else 65535.0)
        grey = np.round(np.clip(values, 0, 1) * 255).astype(np.uint8)
        return np.repeat(grey[:, :, None], 3, axis=2)
    # By way of RGBA, palettes with transparency keep their colours.
    return np.ascontiguousarray(np.array(image.convert("RGBA"))[:, :, :3])
