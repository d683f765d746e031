"""Draw the difference between two images: blue where light is missing, red where there is too much."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from deferred_ir.base.arrays import Array
from deferred_ir.base.colour import LUMINANCE
from deferred_ir.base.files import write_whole
from deferred_ir.base.relative_error import weigh

ERRORS = (-1.0, -0.5, 0.0, 0.5, 1.0)
COLOURS = ((33, 64, 154), (120, 164, 217), (247, 247, 247), (239, 138, 98), (165, 15, 38))
"""sRGB of these signed relative errors, white for none. Readers who cannot tell red from green can tell them apart."""
LEGEND = 34
NARROWEST = 240
"""Height of the legend and the least width in which its words fit, pixels."""


def measure_signed_errors(image: Array, reference: Array, reference_mean: float) -> Array:
    """Return the relative errors of luminance, (Y_I - Y_R) / sqrt(Y_R^2 + 0.01 mean(R)^2), (H, W)."""
    ours, truth = image @ LUMINANCE, reference @ LUMINANCE
    errors: Array = (ours - truth) / np.sqrt(weigh(truth, reference_mean))
    return errors


def colour_errors(errors: Array) -> Any:
    """Return sRGB, uint8 (..., 3), for signed relative errors (...), which are clamped to -1 and 1."""
    planes = [np.interp(errors, ERRORS, plane) for plane in zip(*COLOURS, strict=True)]
    return np.stack(planes, axis=-1).round().astype(np.uint8)


def save(path: Path, errors: Array) -> None:
    """Write signed `errors` (H, W) in false colour as PNG, with a legend; the file appears whole or not at all."""
    from PIL import Image, ImageDraw

    height, width = errors.shape
    wide = max(width, NARROWEST)
    picture = np.full((height + LEGEND, wide, 3), 255, np.uint8)
    picture[:height, :width] = colour_errors(errors)
    bar = np.linspace(-1.0, 1.0, wide - 16)
    picture[height + 4 : height + 16, 8:-8] = colour_errors(bar)
    canvas = Image.fromarray(picture)
    draw = ImageDraw.Draw(canvas)
    for at, text in ((0.0, "-100 %  darker"), (0.5, "0"), (1.0, "brighter  +100 %")):
        draw.text((8 + at * (wide - 16 - draw.textlength(text)), height + 18), text, fill=(0, 0, 0))

    def write(part: Path) -> None:
        canvas.save(part, format="PNG")

    write_whole(path, write)
