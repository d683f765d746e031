"""Open Image Denoise, a network that takes the noise out of light, by the wheel `mitsuba-oidn` (extra `denoise`)."""

from __future__ import annotations

import importlib
import importlib.util
import os
from typing import Any, Literal

import numpy as np

from deferred_ir.base.arrays import Array
from deferred_ir.base.errors import DeviceError

Quality = Literal["fast", "balanced"]

MODULE = "mitsuba_oidn"
INSTALL = "pip install 'deferred-ir[denoise]'"
BORDER = 8
"""Pixels by which the image is mirrored at its edges: the network takes what lies outside for black."""
MIDDLE = 0.1
"""What the ratio 1 becomes in front of the network. By default it goes by each image's own brightness."""


def find_obstacle() -> str | None:
    """Return why nothing can be denoised on this machine, and the mend; None if the wheel is installed."""
    return None if importlib.util.find_spec(MODULE) else f"mitsuba-oidn is not installed; {INSTALL}"


class Denoiser:
    """Denoises images on the CPU. Loads the wheel when it is first asked to.

    threads: None for as many as the machine has. The result depends neither on their number nor on the run.
    """

    def __init__(self, threads: int | None = None) -> None:
        self._threads = threads or os.cpu_count() or 1
        self._filter: Any = None
        self._prepared: tuple[tuple[int, ...], Quality] | None = None

    def denoise(self, noisy: Array, filtered: Array, quality: Quality) -> Array:
        """Return the light `noisy` (H, W, 3) without its noise, float32. Raises DeviceError.

        filtered: the same light, filtered inside surfaces. What is denoised is the ratio of both, which is about 1 on
        all surfaces: the network sees noise, and shadows that the filter has blurred, but no edge across which it could
        blur light. Where `filtered` is 0 or not finite it is returned as it is.
        """
        usable = (filtered > 0) & np.isfinite(filtered) & np.isfinite(noisy)
        ratio = np.divide(noisy, filtered, out=np.zeros(noisy.shape, np.float32), where=usable)
        border = ((BORDER, BORDER), (BORDER, BORDER), (0, 0))
        framed = np.pad(ratio, border, mode="symmetric")
        if self._prepared != (framed.shape, quality):
            self._prepare(framed.shape, quality)
        self._noisy[...] = framed
        self._filter.execute()
        clean = self._clean[BORDER:-BORDER, BORDER:-BORDER]
        result: Array = np.multiply(filtered, clean, out=np.array(filtered, np.float32), where=usable)
        return result

    def _prepare(self, shape: tuple[int, ...], quality: Quality) -> None:
        """Make a filter for images of one shape."""
        try:
            oidn = importlib.import_module(MODULE)
            device = oidn.Device(oidn.DeviceType.CPU)
            device.num_threads = self._threads
            self._filter = device.new_filter("RT")
        except Exception as error:  # a broken wheel can raise anything
            text = " ".join(str(error).split())
            raise DeviceError(f"mitsuba-oidn fails: {text}; pip install --force-reinstall mitsuba-oidn") from error
        self._noisy, self._clean = np.zeros(shape, np.float32), np.zeros(shape, np.float32)
        self._filter.set_image("color", self._noisy)
        self._filter.set_image("output", self._clean)
        self._filter.hdr, self._filter.input_scale = True, MIDDLE
        self._filter.quality = {"fast": oidn.Quality.Fast, "balanced": oidn.Quality.Balanced}[quality]
        self._prepared = shape, quality
