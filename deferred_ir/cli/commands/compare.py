"""`deferred-ir compare`: how far an image is from its reference."""

from __future__ import annotations

import argparse
import os
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from deferred_ir.base.errors import OutputError, SettingError, format_value
from deferred_ir.cli.options import print_notes

if TYPE_CHECKING:
    from deferred_ir.base.arrays import Array
    from deferred_ir.truth.metrics import Comparison
    from deferred_ir.truth.reference_noise import ReferenceNoise

HELP = "Measure how far an image is from its reference: relMSE, RMSE, bias, FLIP."
ORDER = 30


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of `deferred-ir compare`."""
    parser.add_argument("image", metavar="A", help="image of linear radiance, such as .npy or .exr")
    parser.add_argument(
        "reference", metavar="B", help="the reference, likewise; B.json beside it says what it shows, if it is there"
    )
    parser.add_argument("--json", metavar="F", help="write all figures")
    diff = "write where the image is too dark (blue) or too bright (red)"
    parser.add_argument("--diff", metavar="OUT.png", help=diff)


def run(arguments: argparse.Namespace) -> int:
    """Print how far an image is from its reference; write the figures and a picture of the error if asked for."""
    from deferred_ir.base.files import write_json
    from deferred_ir.truth import error_picture
    from deferred_ir.truth.metrics import compare
    from deferred_ir.truth.reference_noise import ReferenceNoise

    image_path, reference_path = Path(arguments.image), Path(arguments.reference)
    json = Path(arguments.json) if arguments.json else None
    diff = Path(arguments.diff) if arguments.diff else None
    _check_outputs(image_path, reference_path, json, diff)
    image, reference = _read(image_path), _read(reference_path)
    _check_same_scene(image, reference)
    _check_same_time(image, reference)
    hit = reference.metadata.get("hit_fraction") or None
    result = compare(image.radiance, reference.radiance, hit, names=(str(image_path), str(reference_path)))
    noise = ReferenceNoise.from_metadata(reference.metadata)
    print_notes(_list_notes(result, image, reference))
    if diff:
        error = error_picture.measure_signed_errors(image.radiance, reference.radiance, result.reference_mean)
        error_picture.save(diff, error)
    if json:
        names = {"image": str(image_path), "reference": str(reference_path)}
        told = {"reference_noise": asdict(noise), "flagged": noise.flag(result.relmse)}
        write_json(json, {**names, "scene_hash": reference.metadata.get("scene_hash"), **result.as_dict(), **told})
    print(format_table(result, noise))
    return 0


@dataclass(frozen=True)
class _Input:
    """An image that is compared, and its metadata, empty if there are none."""

    path: Path
    radiance: Array
    metadata: dict[str, Any]


def _read(path: Path) -> _Input:
    from deferred_ir.output.image import read_radiance
    from deferred_ir.output.metadata import read_metadata

    radiance = read_radiance(path)
    return _Input(path, radiance, read_metadata(path, (radiance.shape[1], radiance.shape[0])))


def format_table(result: Comparison, noise: ReferenceNoise) -> str:
    """Lay out the figures in lines of name, value and what they rest on."""
    left_out = f"without the worst {result.trimmed_pixels} of {result.pixels} pixels"
    own = "-" if noise.relmse is None else f"{noise.relmse:.4g}"
    rows = [
        _make_row("relMSE (trimmed)", result.relmse, noise, left_out),
        _make_row("relMSE (whole)", result.relmse_untrimmed, noise),
        ("reference noise", own, f"{'unknown: ' if noise.relmse is None else 'its own relMSE, '}{noise.how}"),
        ("RMSE", f"{result.rmse:.4g}", f"the reference's mean is {result.reference_mean:.4g}"),
        ("bias", f"{100 * result.bias:+.3f} %", "mean(I - R) / mean(R)"),
    ]
    if result.flip is None or result.flip_parameters is None:
        rows.append(("FLIP", "-", str(result.flip_note)))
    else:
        used = result.flip_parameters
        exposures = f"{used.exposures} exposures, {used.start_exposure:+.2f} to {used.stop_exposure:+.2f} stops"
        rows.append(("FLIP", f"{result.flip:.4g}", exposures))
    width = max(len(value) for _, value, _ in rows)
    return "\n".join(f"{name:<16}  {value:>{width}}  {remark}".rstrip() for name, value, remark in rows)


def _make_row(name: str, error: float, noise: ReferenceNoise, remark: str = "") -> tuple[str, str, str]:
    """Return a row for a relMSE, and how much of it is the reference's noise where that is not little."""
    remarks = [remark] if remark else []
    if noise.hides(error):
        remarks.append(f"{error:.4g} was measured, most of it the reference's noise")
    elif noise.relmse is not None and noise.flag(error):
        remarks.append(f"{noise.relmse / error:.0%} of it is the reference's noise")
    return name, noise.quote(error, 4), "; ".join(remarks)


def _check_outputs(image: Path, reference: Path, json: Path | None, diff: Path | None) -> None:
    """Raise OutputError, before the work, if an output cannot be written or would replace an input."""
    from deferred_ir.base.files import check_folder
    from deferred_ir.output.find_format import list_suffixes
    from deferred_ir.output.metadata import metadata_path

    pictures = list_suffixes("display")
    if diff and diff.suffix.lower() not in pictures:
        raise OutputError(f"{diff}: the difference is a picture; name a {' or '.join(pictures)}")
    inputs = {os.path.realpath(file) for path in (image, reference) for file in (path, metadata_path(path))}
    for output in (json, diff):
        if output is None:
            continue
        check_folder(output)
        if os.path.realpath(output) in inputs:
            raise OutputError(f"{output}: is an image that is compared, or lies beside one; choose another name")


def _check_same_scene(image: _Input, reference: _Input) -> None:
    """Raise SettingError if the metadata say that the images show different scenes."""
    both = image.metadata, reference.metadata
    if all(both) and both[0]["scene_hash"] != both[1]["scene_hash"]:
        names = [f"{format_value(one.get('scene'))} ({format_value(one['scene_hash'])})" for one in both]
        raise SettingError(
            f"{image.path}: shows the scene {names[0]}, but {reference.path} shows {names[1]}; compare like with like"
        )


def _check_same_time(image: _Input, reference: _Input) -> None:
    """Raise SettingError if the metadata give different times of a scene that moves.

    Metadata of still scenes say 0; those of other programs may leave the time out, and are not checked.
    """
    now, then = image.metadata.get("time"), reference.metadata.get("time")
    if isinstance(now, int | float) and isinstance(then, int | float) and abs(now - then) > 1e-3:
        raise SettingError(
            f"{image.path}: shows the scene at {now:.4f} s, but {reference.path} shows it at {then:.4f} s; trace a "
            f"reference of that time: deferred-ir reference --time {now:.4f}"
        )


def _list_notes(result: Comparison, image: _Input, reference: _Input) -> Iterator[str]:
    """Yield what was not checked, and what the figures take for background."""
    from deferred_ir.output.metadata import metadata_path

    missing = [one.path for one in (reference, image) if not one.metadata]
    if missing:
        name = metadata_path(missing[0]).name
        yield f"{missing[0]}: no metadata in {name} beside it, so whether both show the same scene is not checked"
    size = result.size[0] * result.size[1]
    if result.pixels_by == "lit" and result.pixels < size:
        yield f"{size - result.pixels} pixels, black in both images, are taken for background"
    elif result.pixels_by == "hit fraction":
        extra = result.pixels - round(reference.metadata["hit_fraction"] * size)
        if extra > 0:
            yield f"{image.path}: is lit in {extra} pixels more than the reference's camera rays hit"
