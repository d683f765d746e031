"""Reflectance: from the materials of model files, and at any point of a scene.

Numbers in files (OBJ `Kd`, glTF base colours and `COLOR_0`) are linear. Images, and the vertex and face colours of
PLY, OBJ and other formats, are sRGB.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

import numpy as np

from deferred_ir.base.arrays import Array, Ints, Vec3
from deferred_ir.base.errors import SceneError
from deferred_ir.scene.scene import Scene, Texture

GREY = (0.8, 0.8, 0.8)
"""Albedo of a surface for which the file gives none."""


@lru_cache(maxsize=1)
def srgb_table() -> Array:
    """Linear values of the 256 sRGB levels (IEC 61966-2-1), float32 (256,)."""
    table = linear_from_srgb(np.arange(256) / 255).astype(np.float32)
    table.flags.writeable = False
    return table


def linear_from_srgb(values: Array) -> Array:
    """Linear values of sRGB ones in 0 to 1, float64."""
    clipped = np.clip(np.asarray(values, dtype=np.float64), 0, 1)
    linear: Array = np.where(clipped <= 0.04045, clipped / 12.92, ((clipped + 0.055) / 1.055) ** 2.4)
    return linear


def checked_albedo(values: Any, where: str, notes: list[str]) -> Vec3:
    """Linear RGB of a file as an albedo: one number stands for three, above 1 it is cut to 1 with a note.

    Raises SceneError for what is no number, negative or not finite.
    """
    numbers = [float(value) for value in np.ravel(values)]
    numbers = numbers * 3 if len(numbers) == 1 else numbers[:3]
    if len(numbers) != 3 or not all(math.isfinite(value) and value >= 0 for value in numbers):
        raise SceneError(f"{where}: reflectance {numbers} must be three finite numbers of 0 or more; mend the file")
    if max(numbers) > 1:
        notes.append(f"{where}: reflectance above 1 is cut to 1")
    red, green, blue = (min(value, 1.0) for value in numbers)
    return red, green, blue


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
"""What is read, by PIL's names. Not EPS and the like, for which PIL runs other programs."""
LARGEST_IMAGE = 1 << 26
"""Most pixels of an image, 8192x8192: a few hundred bytes can declare any number."""


def texture_from_image(image: Any, name: str, notes: list[str]) -> Texture:
    """A PIL image of one of IMAGE_FORMATS as 8-bit RGB. Raises SceneError where its file is broken, or too large."""
    if image.format is not None and image.format not in IMAGE_FORMATS:
        raise SceneError(f"{name}: images of format {image.format} are not read; save it as PNG or JPEG")
    width, height = image.size
    if width * height > LARGEST_IMAGE:
        raise SceneError(f"{name}: {width}x{height} pixels, and {LARGEST_IMAGE} are the most; scale it down")
    try:
        image.load()
        pixels = _rgb(image)
    except Exception as error:  # PIL's decoders raise many kinds; each means that the file is broken
        raise SceneError(f"{name}: not a readable image ({' '.join(str(error).split())}); replace the file") from error
    if "A" in image.getbands() or "transparency" in image.info:
        notes.append(f"{name}: transparency is ignored")
    return Texture(name, pixels)


def _rgb(image: Any) -> Any:
    """Pixels of a PIL image, uint8 (H, W, 3)."""
    if image.mode.startswith("I") or image.mode == "F":
        # PIL would clip these to 255; 16 bits are what PNG and TIFF store in them, floats run to 1.
        values = np.asarray(image, dtype=np.float64) / (1.0 if image.mode == "F" else 65535.0)
        grey = np.round(np.clip(values, 0, 1) * 255).astype(np.uint8)
        return np.repeat(grey[:, :, None], 3, axis=2)
    # By way of RGBA, palettes with transparency keep their colours.
    return np.ascontiguousarray(np.array(image.convert("RGBA"))[:, :, :3])


def albedo(scene: Scene, faces: Ints, weights: Array) -> Array:
    """Reflectance at points of `faces` (n,) with barycentric `weights` (n, 3): float64 (n, 3), linear RGB.

    Material's albedo times vertex colour times texture, as the rasteriser has it.
    """
    geometry = scene.geometry
    materials = geometry.face_materials[faces]
    result: Array = np.array([material.albedo for material in scene.materials], dtype=np.float64)[materials]
    corners = geometry.faces[faces]
    blend = np.asarray(weights, dtype=np.float64)[..., None]
    if geometry.colors is not None:
        result *= (geometry.colors[corners] * blend).sum(axis=1)
    if geometry.uvs is None:
        return result
    textures = np.array([-1 if material.texture is None else material.texture for material in scene.materials])
    for index in np.unique(textures[materials]):
        if index >= 0:
            rows = textures[materials] == index
            uvs = (geometry.uvs[corners[rows]] * blend[rows]).sum(axis=1)
            result[rows] *= sample(scene.textures[index], uvs)
    return result


def sample(texture: Texture, uvs: Array) -> Array:
    """A texture's linear RGB at `uvs` (n, 2), float64 (n, 3): bilinear at the base level, decoded before filtering.

    As in OpenGL with wrap mode repeat: texel centres lie at (i + 0.5) / width, v = 1 is the top edge.
    """
    height, width = texture.pixels.shape[:2]
    u, v = np.asarray(uvs, dtype=np.float64).T
    x = (u - np.floor(u)) * width - 0.5
    y = (1 - (v - np.floor(v))) * height - 0.5
    left, top = np.floor(x).astype(np.int64), np.floor(y).astype(np.int64)
    right, bottom = (left + 1) % width, (top + 1) % height
    across, down = (x - left)[:, None], (y - top)[:, None]
    left, top = left % width, top % height
    table = srgb_table().astype(np.float64)
    upper, lower = (
        table[texture.pixels[row, left]] * (1 - across) + table[texture.pixels[row, right]] * across
        for row in (top, bottom)
    )
    result: Array = upper * (1 - down) + lower * down
    return result
