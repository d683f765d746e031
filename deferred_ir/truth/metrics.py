"""Measure the distance of an image from its reference: relMSE, RMSE, bias and FLIP, all on linear radiance.

An image is a float array (H, W, 3). Every function raises a SettingError that names the image where nothing can be
measured: other shapes, different sizes, a reference without light, and values that are not finite, which an average
would either spread or hide.

Errors are averaged over the pixels in which the camera ray hits a surface. `hit` tells which pixels these are:

* a bool array (H, W): exactly these pixels;
* a number in (0, 1]: the fraction of the pixels that are hit. This is enough, because the background is black in both
  images and adds nothing to a sum. If more pixels than that are lit, all lit pixels count;
* None: the lit pixels, which are not 0 in all channels of both images. A surface that no light reaches in either image
  then counts as background, so the other surfaces weigh more.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from deferred_ir.base.arrays import Array, Bools
from deferred_ir.base.errors import SettingError
from deferred_ir.base.relative_error import count_kept, trimmed_mean, weigh
from deferred_ir.output.image import check_radiance
from deferred_ir.truth import flip
from deferred_ir.truth.flip import FlipParameters

DARKEST = float(np.finfo(np.float32).tiny)
"""Mean radiance of a reference below which it counts as black."""
NAMES = ("image", "reference")

Hit = Bools | float | None


@dataclass(frozen=True)
class Comparison:
    """All figures of a comparison. Means are over the pixels that count, and over RGB.

    flip: None if FLIP could not be measured; flip_note then says why. size: (width, height). pixels: how many count.
    pixels_by: `mask`, `hit fraction` or `lit`, which told how many. trimmed_pixels: how many trimmed relMSE leaves out.
    """

    relmse: float
    relmse_untrimmed: float
    rmse: float
    bias: float
    flip: float | None
    flip_note: str | None
    flip_parameters: FlipParameters | None
    size: tuple[int, int]
    pixels: int
    pixels_by: str
    trimmed_pixels: int
    image_mean: float
    reference_mean: float

    def as_dict(self) -> dict[str, Any]:
        """Return plain data for JSON."""
        return {**asdict(self), "size": list(self.size)}


@dataclass(frozen=True, eq=False)
class _Pair:
    """Two comparable images in double precision. count: the number of pixels that an average is over."""

    image: Array
    reference: Array
    mask: Bools
    count: int
    counted_by: str

    @property
    def mean(self) -> float:
        """The mean radiance of the reference."""
        return float(self.reference[self.mask].sum() / (3 * self.count))

    def errors(self) -> Array:
        """Return squared relative errors, averaged over RGB, (H, W); 0 outside the mask."""
        errors: Array = ((self.image - self.reference) ** 2 / weigh(self.reference, self.mean)).mean(-1)
        return np.where(self.mask, errors, 0.0)

    def relmse(self) -> tuple[float, float]:
        errors = self.errors()
        return trimmed_mean(errors, self.count), float(errors.sum() / self.count)

    def rmse(self) -> float:
        squares = (self.image - self.reference)[self.mask] ** 2
        return float(np.sqrt(squares.sum() / (3 * self.count)))

    def bias(self) -> float:
        return float((self.image - self.reference)[self.mask].sum() / self.reference[self.mask].sum())


def compare(
    image: Any,
    reference: Any,
    hit: Hit = None,
    *,
    names: tuple[str, str] = NAMES,
    flip_parameters: FlipParameters | None = None,
) -> Comparison:
    """Measure all figures. `names` are what messages call the two images.

    Pass the same `flip_parameters` for all images of a sweep; the default is FlipParameters.from_reference(reference).
    """
    pair = _make_pair(image, reference, hit, names)
    trimmed, untrimmed = pair.relmse()
    note = flip.find_obstacle(pair.image, pair.reference, names)
    value = None
    if note is None:
        flip_parameters = flip_parameters or FlipParameters.from_reference(pair.reference)
        value = flip.measure_flip(pair.image, pair.reference, flip_parameters)
    height, width, _ = pair.image.shape
    return Comparison(
        relmse=trimmed,
        relmse_untrimmed=untrimmed,
        rmse=pair.rmse(),
        bias=pair.bias(),
        flip=value,
        flip_note=note,
        flip_parameters=flip_parameters if note is None else None,
        size=(width, height),
        pixels=pair.count,
        pixels_by=pair.counted_by,
        trimmed_pixels=pair.count - count_kept(pair.count),
        image_mean=float(pair.image[pair.mask].sum() / (3 * pair.count)),
        reference_mean=pair.mean,
    )


def relmse(image: Any, reference: Any, hit: Hit = None) -> tuple[float, float]:
    """Return relMSE without the worst 0.1 % of the pixels (but with one at least), and relMSE of all."""
    return _make_pair(image, reference, hit, NAMES).relmse()


def masked_relmse(image: Any, reference: Any, mask: Bools) -> float | None:
    """Return trimmed relMSE of the pixels in `mask`, bool (H, W), mean(R) included, as if there were no others.

    None if the mask is empty or the reference is black in it.
    """
    if not np.asarray(reference)[mask].any():
        return None
    return relmse(image, reference, mask)[0]


def rmse(image: Any, reference: Any, hit: Hit = None) -> float:
    """Return the root of the mean of (I - R)^2, in units of radiance."""
    return _make_pair(image, reference, hit, NAMES).rmse()


def bias(image: Any, reference: Any, hit: Hit = None) -> float:
    """Return mean(I - R) / mean(R): -0.1 means that a tenth of the light is missing."""
    return _make_pair(image, reference, hit, NAMES).bias()


def _make_pair(image: Any, reference: Any, hit: Hit, names: tuple[str, str]) -> _Pair:
    first, second = check_radiance(image, names[0]), check_radiance(reference, names[1])
    if first.shape != second.shape:
        sizes = [f"{array.shape[1]}x{array.shape[0]}" for array in (first, second)]
        raise SettingError(f"{names[0]}: is {sizes[0]}, but {names[1]} is {sizes[1]}; render it at --size {sizes[1]}")
    mask, count, counted_by = _count_pixels(first, second, hit)
    if second[mask].sum() < DARKEST * 3 * count or count == 0:
        raise SettingError(f"{names[1]}: is black; no error is relative to that")
    return _Pair(first, second, mask, count, counted_by)


def _count_pixels(image: Array, reference: Array, hit: Hit) -> tuple[Bools, int, str]:
    """Return the mask over which errors are summed, the number of pixels that counts, and what told that number."""
    everywhere = np.ones(image.shape[:2], np.bool_)
    lit = int(((image != 0) | (reference != 0)).any(-1).sum())
    if hit is None:
        return everywhere, lit, "lit"
    if isinstance(hit, np.ndarray):
        if hit.dtype != np.bool_ or hit.shape != everywhere.shape:
            raise SettingError(f"hit: is {hit.dtype} {hit.shape}; wants bool {everywhere.shape}")
        return hit, int(hit.sum()), "mask"
    if not 0 < hit <= 1:
        raise SettingError(f"hit: {hit} is no fraction of the pixels; wants a number above 0, at most 1")
    return everywhere, max(round(hit * everywhere.size), lit), "hit fraction"
