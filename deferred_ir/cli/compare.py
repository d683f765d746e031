"""`deferred-ir compare`: how far an image is from its reference."""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path
from typing import Any

from deferred_ir.base.errors import OutputError, SettingError, shown
from deferred_ir.base.files import check_folder, write_json
from deferred_ir.output.read import read_radiance, read_record, record_path
from deferred_ir.truth import error_picture
from deferred_ir.truth.metrics import Comparison, compare


def run(arguments: argparse.Namespace) -> int:
    """Compare two images as the command line asks; an exit status."""
    image_path, reference_path = Path(arguments.image), Path(arguments.reference)
    json = Path(arguments.json) if arguments.json else None
    diff = Path(arguments.diff) if arguments.diff else None
    _check_outputs(image_path, reference_path, json, diff)
    image, reference = read_radiance(image_path), read_radiance(reference_path)
    image_record = read_record(image_path, (image.shape[1], image.shape[0]))
    reference_record = read_record(reference_path, (reference.shape[1], reference.shape[0]))
    _same_scene(image_path, image_record, reference_path, reference_record)
    _same_time(image_path, image_record, reference_path, reference_record)
    hit = reference_record.get("hit_fraction") or None
    result = compare(image, reference, hit, names=(str(image_path), str(reference_path)))
    for note in _notes(result, image_path, image_record, reference_path, reference_record):
        print(f"note: {note}", file=sys.stderr)
    if diff:
        error_picture.save(diff, error_picture.signed_error(image, reference, result.reference_mean))
    if json:
        names = {"image": str(image_path), "reference": str(reference_path)}
        write_json(json, {**names, "scene_hash": reference_record.get("scene_hash"), **result.as_dict()})
    print(table(result))
    return 0


def table(result: Comparison) -> str:
    """The figures in lines of name, value and what they rest on."""
    left_out = f"without the worst {result.trimmed_pixels} of {result.pixels} pixels"
    rows = [
        ("relMSE (trimmed)", f"{result.relmse:.4g}", left_out),
        ("relMSE (whole)", f"{result.relmse_untrimmed:.4g}", ""),
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


def _check_outputs(image: Path, reference: Path, json: Path | None, diff: Path | None) -> None:
    """Before the work: what is written must be writable, and must not be what is read."""
    if diff and diff.suffix.lower() != ".png":
        raise OutputError(f"{diff}: the difference is a picture; name a .png")
    inputs = {os.path.realpath(path) for given in (image, reference) for path in (given, record_path(given))}
    for output in (json, diff):
        if output is None:
            continue
        check_folder(output)
        if os.path.realpath(output) in inputs:
            raise OutputError(f"{output}: is an image that is compared, or its record; choose another name")


def _same_scene(image: Path, ours: dict[str, Any], reference: Path, theirs: dict[str, Any]) -> None:
    if ours and theirs and ours["scene_hash"] != theirs["scene_hash"]:
        names = [f"{shown(record.get('scene'))} ({shown(record['scene_hash'])})" for record in (ours, theirs)]
        raise SettingError(
            f"{image}: shows the scene {names[0]}, but {reference} shows {names[1]}; compare like with like"
        )


def _same_time(image: Path, ours: dict[str, Any], reference: Path, theirs: dict[str, Any]) -> None:
    """Of scenes that move; records of still ones say 0. Those of other programs may say nothing."""
    now, then = ours.get("time"), theirs.get("time")
    if isinstance(now, int | float) and isinstance(then, int | float) and abs(now - then) > 1e-3:
        raise SettingError(
            f"{image}: shows the scene at {now:.4f} s, but {reference} shows it at {then:.4f} s; make that by: "
            f"deferred-ir reference --time {now:.4f}"
        )


def _notes(result: Comparison, image: Path, ours: dict[str, Any], reference: Path, theirs: dict[str, Any]) -> list[str]:
    notes = [
        f"{path}: no record {record_path(path).name} beside it; that both show the same scene is not checked"
        for path, record in ((reference, theirs), (image, ours))
        if not record
    ][:1]
    size = result.size[0] * result.size[1]
    if result.pixels_by == "lit" and result.pixels < size:
        notes.append(f"{size - result.pixels} pixels, black in both images, are taken for background")
    elif result.pixels_by == "hit fraction" and result.pixels > (counted := round(theirs["hit_fraction"] * size)):
        notes.append(f"{image}: is lit in {result.pixels - counted} pixels more than the reference's camera rays hit")
    return notes
