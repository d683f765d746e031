"""Images of a whole environment in latitude and longitude: reading, look-up, and directions in proportion to them.

docs/conventions.md: +y is up, the middle of the image lies at -z and +x to its right; texel centres lie at
(i + 0.5) / width and (j + 0.5) / height, and values between them are bilinear.
"""

from __future__ import annotations

import hashlib
import os
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from deferred_ir.base.arrays import Array, Ints
from deferred_ir.base.colour import LUMINANCE, linear_from_srgb
from deferred_ir.base.errors import SceneError

SUFFIXES = (".hdr", ".exr", ".png")
LARGEST_IMAGE = 1 << 26
"""Most pixels of an image, 8192x8192."""
MOST_CELLS = 1024
"""Most cells of the table that directions are drawn from, across; half as many down."""


@dataclass(frozen=True, eq=False)
class EnvironmentImage:
    """Radiance by direction. pixels: linear RGB, float32 (H, W, 3), top row first. name: the file's, or a label."""

    pixels: Array
    name: str = "image"

    def __post_init__(self) -> None:
        """Check the pixels and make them read-only. Raises SceneError."""
        pixels = np.array(self.pixels, np.float32)
        if pixels.ndim != 3 or pixels.shape[2] != 3 or 0 in pixels.shape:
            raise SceneError(f"{self.name}: has the shape {pixels.shape}; an environment image is (H, W, 3)")
        if not np.isfinite(pixels).all():
            raise SceneError(
                f"{self.name}: {int((~np.isfinite(pixels)).sum())} values are NaN or infinite; export it again"
            )
        if pixels.min() < 0:
            raise SceneError(f"{self.name}: {int((pixels < 0).sum())} values are negative; radiance is 0 or more")
        pixels.flags.writeable = False
        object.__setattr__(self, "pixels", pixels)

    @cached_property
    def digest(self) -> str:
        """First 16 hex digits of SHA-256 of its contents."""
        shape = repr(self.pixels.shape).encode()
        return hashlib.sha256(shape + np.ascontiguousarray(self.pixels).tobytes()).hexdigest()[:16]

    def __eq__(self, other: object) -> bool:
        return isinstance(other, EnvironmentImage) and self.digest == other.digest

    def __hash__(self) -> int:
        return hash(self.digest)

    def __repr__(self) -> str:
        return f"EnvironmentImage({self.digest})"

    def look_up(self, directions: Array) -> Array:
        """Return the radiance in unit `directions` (n, 3), float64 (n, 3)."""
        height, width = self.pixels.shape[:2]
        x = (np.arctan2(directions[:, 0], -directions[:, 2]) / (2 * np.pi) + 0.5) * width - 0.5
        y = np.arccos(np.clip(directions[:, 1], -1, 1)) / np.pi * height - 0.5
        left, top = np.floor(x).astype(np.int64), np.floor(y).astype(np.int64)
        across, down = (x - left)[:, None], (y - top)[:, None]
        rows = [np.clip(top + i, 0, height - 1) for i in (0, 1)]
        upper, lower = (
            self.pixels[row, left % width] * (1 - across) + self.pixels[row, (left + 1) % width] * across
            for row in rows
        )
        radiance: Array = upper * (1 - down) + lower * down
        return radiance

    @cached_property
    def _table(self) -> tuple[Array, Array, Array, Array]:
        """The table of cells: mean luminance (h, w), ends of the rows' and, by row, of the cells' chances, cosines.

        A cell's mean is that of the bilinear image: it is 0 only where the image is.
        """
        luminance = self.pixels.astype(np.float64) @ LUMINANCE
        means = _average(_average(luminance, 0, wraps=False), 1, wraps=True)
        means = _reduce(_reduce(means, 0, MOST_CELLS // 2), 1, MOST_CELLS)
        height, width = means.shape
        cosines = np.cos(np.linspace(0, np.pi, height + 1))
        solid = -np.diff(cosines) * (2 * np.pi / width)
        chances = means * solid[:, None]
        rows = chances.sum(axis=1)
        columns = np.cumsum(chances, axis=1) / np.maximum(rows, np.finfo(float).tiny)[:, None]
        return means, np.cumsum(rows), columns, cosines

    @cached_property
    def flux(self) -> float:
        """The integral of the luminance over all directions."""
        return float(self._table[1][-1])

    def draw(self, square: Array) -> tuple[Array, Array]:
        """Return unit directions (n, 3) for points of the unit square (n, 2), about in proportion to luminance.

        Also their densities over solid angle, (n,); infinite for an image that is all black.
        """
        means, rows, columns, cosines = self._table
        height, width = means.shape
        mark = square[:, 1] * rows[-1]
        row = np.minimum(np.searchsorted(rows, mark, side="right"), height - 1)
        before = np.where(row > 0, rows[row - 1], 0.0)
        v = np.clip((mark - before) / np.maximum(rows[row] - before, np.finfo(float).tiny), 0, 1)
        column = _search_rows(columns, row, square[:, 0])
        start = np.where(column > 0, columns[row, column - 1], 0.0)
        u = np.clip((square[:, 0] - start) / np.maximum(columns[row, column] - start, np.finfo(float).tiny), 0, 1)
        y = cosines[row] + v * (cosines[row + 1] - cosines[row])
        angle = 2 * np.pi * ((column + u) / width - 0.5)
        ring = np.sqrt(np.maximum(1 - y * y, 0))
        directions = np.stack([ring * np.sin(angle), y, -ring * np.cos(angle)], axis=1)
        density = means[row, column] / self.flux if self.flux > 0 else np.full(len(square), np.inf)
        return directions, density

    def find_density(self, directions: Array) -> Array:
        """Return the density with which `draw` draws unit `directions` (n, 3), (n,)."""
        means, _, _, cosines = self._table
        height, width = means.shape
        row = np.clip(np.searchsorted(-cosines, -directions[:, 1], side="right") - 1, 0, height - 1)
        turn = np.arctan2(directions[:, 0], -directions[:, 2]) / (2 * np.pi) + 0.5
        column = np.clip((turn * width).astype(np.int64), 0, width - 1)
        density: Array = means[row, column] / max(self.flux, np.finfo(float).tiny)
        return density


def read_image(path: str | os.PathLike[str]) -> EnvironmentImage:
    """Read an .hdr, .exr or .png file; .png is decoded from sRGB. Raises SceneError."""
    file = Path(path)
    if file.suffix.lower() not in SUFFIXES:
        raise SceneError(f"{file}: environment images are {', '.join(SUFFIXES[:-1])} or {SUFFIXES[-1]}")
    if not file.is_file():
        raise SceneError(f"{file}: no such file; give the environment's image")
    is_png = file.suffix.lower() == ".png"
    data = file.read_bytes() if is_png else b""
    if data.startswith(b"\x89PNG") and b"IEND" not in data:  # of this libpng would print lines of its own
        raise SceneError(f"{file}: broken (cut short); export it again")
    pixels = _decode(file)
    if is_png:
        pixels = linear_from_srgb(pixels)
    return EnvironmentImage(pixels, str(file))


def _decode(file: Path) -> Array:
    """Return the colours of an image file, float32 (H, W, 3)."""
    import OpenImageIO

    image = OpenImageIO.ImageInput.open(str(file))
    if image is None:
        raise SceneError(
            f"{file}: not an image that can be read ({_summarise(OpenImageIO.geterror())}); export it again"
        )
    try:
        spec = image.spec()
        if spec.width * spec.height > LARGEST_IMAGE:
            raise SceneError(
                f"{file}: {spec.width}x{spec.height} pixels, and {LARGEST_IMAGE} are the most; scale it down"
            )
        data = image.read_image("float")
        if data is None:
            raise SceneError(f"{file}: broken ({_summarise(image.geterror())}); export it again")
    finally:
        image.close()
    pixels: Any = np.asarray(data, np.float32).reshape(spec.height, spec.width, -1)
    return pixels[..., :3] if pixels.shape[2] >= 3 else np.repeat(pixels[..., :1], 3, axis=2)


def _summarise(text: str) -> str:
    return " ".join(text.split()) or "no reason given"


def _average(values: Array, axis: int, *, wraps: bool) -> Array:
    """Return means of the linear interpolation along `axis` over halves of texels: twice as many values."""
    values = np.moveaxis(values, axis, 0)
    before, after = np.roll(values, 1, axis=0), np.roll(values, -1, axis=0)
    if not wraps:
        before[0], after[-1] = values[0], values[-1]
    halves = np.stack([(3 * values + before) / 4, (3 * values + after) / 4], axis=1)
    return np.moveaxis(halves.reshape(-1, *values.shape[1:]), 0, axis)


def _reduce(values: Array, axis: int, most: int) -> Array:
    """Return means of `values`, constant in cells of equal size, over no more than `most` cells along `axis`."""
    count = values.shape[axis]
    if count <= most:
        return values
    values = np.moveaxis(values, axis, 0)
    sums = np.concatenate([np.zeros((1, *values.shape[1:])), np.cumsum(values, axis=0)])
    ends = np.arange(most + 1) * (count / most)
    whole = np.minimum(ends.astype(np.int64), count - 1)
    at_ends = sums[whole] + values[whole] * (ends - whole)[:, None]
    return np.moveaxis(np.diff(at_ends, axis=0) * (most / count), 0, axis)


def _search_rows(ends: Array, row: Ints, marks: Array) -> Ints:
    """Return in which cell of its `row` (n,) of ascending `ends` (h, w), up to 1, a mark (n,) lies, int (n,)."""
    flat = (ends + np.arange(len(ends))[:, None]).reshape(-1)
    found = np.searchsorted(flat, marks + row, side="right") - row * ends.shape[1]
    cells: Ints = np.clip(found, 0, ends.shape[1] - 1)
    return cells
