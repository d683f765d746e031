"""Decodes image textures: with PIL, and PNG of 16 bits with OpenImageIO."""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
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


def open_image(data: bytes) -> Any | None:
    """Return the PIL image in a file's contents, whose pixels are not decoded yet; None where it is none."""
    from PIL import Image

    try:
        return Image.open(io.BytesIO(data))
    except Exception:  # PIL's readers raise many kinds; each means that the file is broken, or of no known format
        return None


def decode_texture(image: Any, name: str, *, alpha: bool = False) -> Texture:
    """Decode a PIL image of one of IMAGE_FORMATS to RGB of 8 or 16 bits. alpha: keep its coverage, if it has any.

    Raises SceneError where the file is broken, too large or of another format.
    """
    if image.format is not None and image.format not in IMAGE_FORMATS:
        raise SceneError(f"{name}: images of format {image.format} are not read; save it as PNG or JPEG")
    width, height = image.size
    if width * height > LARGEST_IMAGE:
        raise SceneError(f"{name}: {width}x{height} pixels, and {LARGEST_IMAGE} are the most; scale it down")
    try:
        pixels = _read_deep_png(image) if _is_deep_png(image) else _read_pixels(image)
    except Exception as error:  # PIL's decoders raise many kinds; each means that the file is broken
        raise SceneError(f"{name}: not a readable image ({' '.join(str(error).split())}); replace the file") from error
    has_alpha = "A" in image.getbands() or "transparency" in image.info
    return Texture(name, np.ascontiguousarray(pixels[:, :, : 4 if alpha and has_alpha else 3]))


def join_greys(textures: Sequence[Texture | None]) -> Any:
    """Return a PIL image of 8 bits whose red, green and blue are the first channels of three textures; white for None.

    They are scaled to the largest.
    """
    from PIL import Image

    given = [texture.pixels.shape[:2] for texture in textures if texture is not None]
    size = max(width for _, width in given), max(height for height, _ in given)
    bands = []
    for texture in textures:
        plane = np.full(size[::-1], 255, np.uint8) if texture is None else texture.pixels[:, :, 0]
        grey = Image.fromarray((plane // 257).astype(np.uint8) if plane.dtype == np.uint16 else plane)
        bands.append(grey if grey.size == size else grey.resize(size, Image.Resampling.BILINEAR))
    return Image.merge("RGB", bands)


def _read_pixels(image: Any) -> Any:
    """Return the pixels of a PIL image: uint8 (H, W, 4), or uint16 (H, W, 3) where it is deep and grey."""
    image.load()
    if image.mode.startswith("I") or image.mode == "F":
        # 16 bits are what PNG and TIFF store in integers, floats run to 1.
        values = np.asarray(image, dtype=np.float64) * (65535.0 if image.mode == "F" else 1.0)
        grey = np.round(np.clip(values, 0, 65535)).astype(np.uint16)
        return np.repeat(grey[:, :, None], 3, axis=2)
    # By way of RGBA, palettes with transparency keep their colours.
    return np.array(image.convert("RGBA"))


def _is_deep_png(image: Any) -> bool:
    """Return whether a PIL image is a PNG of 16 bits in colour, or with coverage, of which PIL reads 8."""
    return image.format == "PNG" and image.mode != "I;16" and any(";16" in str(tile[3]) for tile in image.tile)


def _read_deep_png(image: Any) -> Any:
    """Return all bits of a PNG, uint16 (H, W, 3 or 4)."""
    import OpenImageIO

    image.fp.seek(0)
    with TemporaryDirectory() as folder:  # OpenImageIO's Python binding reads from files alone
        path = Path(folder) / "image.png"
        path.write_bytes(image.fp.read())
        plain = OpenImageIO.ImageSpec()
        plain.attribute("oiio:UnassociatedAlpha", 1)  # else colours come multiplied by alpha
        reader = OpenImageIO.ImageInput.open(str(path), plain)
        pixels = None if reader is None else reader.read_image("uint16")
        if reader is None or pixels is None:
            raise ValueError(OpenImageIO.geterror() if reader is None else reader.geterror())
        reader.close()
    if pixels.shape[2] < 3:
        return np.concatenate([np.repeat(pixels[:, :, :1], 3, axis=2), pixels[:, :, 1:]], axis=2)
    return pixels
