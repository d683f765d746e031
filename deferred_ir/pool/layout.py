"""Samples: the pixels that ask for indirect light, and where each stands in textures of the frame's size.

Every `scale`-th pixel of every `scale`-th row is a sample, the grid. It fills the lower left corner. The pixels that no
sample of the grid can stand for follow as a list, in the rows above and then in the strip to the right, so that there
is room for all pixels of any frame.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from deferred_ir.base.arrays import Ints
from deferred_ir.sampling import streams

NONE = 0xFFFFFFFF
"""Stands for the pixel of a texel that has no sample."""
LONELY = 0x80000000
"""Flag of a pixel that is a sample of the list; the other bits of its texel of `blend` are its place."""


@dataclass(frozen=True)
class Layout:
    """Where the samples of a frame stand.

    size: (width, height) of the frame, pixels. scale: pixels from sample to sample of the grid. offset: (x, y) of the
    grid's first pixel. listed: samples of the list.
    """

    size: tuple[int, int]
    scale: int
    offset: tuple[int, int] = (0, 0)
    listed: int = 0

    @classmethod
    def of_frame(cls, size: tuple[int, int], scale: int, seed: int) -> Layout:
        """Return the layout of a frame. Each seed moves the grid, so that the mean over seeds favours no pixel."""
        x, y = streams.sample_grid(seed).integers(0, scale, 2).tolist()
        return cls(size, scale, (x, y))

    @property
    def grid(self) -> tuple[int, int]:
        """Samples of the grid across and up."""
        (width, height), scale = self.size, self.scale
        return -(-width // scale), -(-height // scale)

    def find_grid_pixels(self) -> Ints:
        """Return the pixel number (row * width + column) of each sample of the grid, int (rows, columns).

        The last row and column of a frame that `scale` does not divide may stand for a pixel within it.
        """
        (width, height), (columns, rows), (left, bottom) = self.size, self.grid, self.offset
        x = np.minimum(np.arange(columns) * self.scale + left, width - 1)
        y = np.minimum(np.arange(rows) * self.scale + bottom, height - 1)
        return y[:, None] * width + x

    def find_list_places(self) -> Ints:
        """Return the texels (row * width + column) of the list's samples, int (listed,)."""
        (width, height), (columns, rows) = self.size, self.grid
        number = np.arange(self.listed)
        beside = np.maximum(number - width * (height - rows), 0)
        strip = max(width - columns, 1)
        over = number >= width * (height - rows)
        return np.where(over, beside // strip * width + columns + beside % strip, rows * width + number)

    def place(self, listed: Ints) -> Ints:
        """Return the pixel number of the sample in each texel, uint32 (H, W), NONE where there is none.

        listed: pixel numbers of the list's samples, int (listed,).
        """
        (width, height), (columns, rows) = self.size, self.grid
        pixels = np.full((height, width), NONE, np.uint32)
        pixels[:rows, :columns] = self.find_grid_pixels()
        pixels.reshape(-1)[self.find_list_places()] = listed
        return pixels

    def list_rectangles(self) -> list[tuple[int, int, int, int]]:
        """Return (x, y, width, height) of the parts of the texture that hold samples."""
        (width, height), (columns, rows) = self.size, self.grid
        parts = [(0, 0, columns, rows)]
        above = min(self.listed, width * (height - rows))
        if above:
            parts.append((0, rows, width, -(-above // width)))
        if self.listed > above:
            strip = width - columns
            parts.append((columns, 0, strip, -(-(self.listed - above) // strip)))
        return parts
