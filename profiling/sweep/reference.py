"""The reference of a sweep: one that is given, or one traced until its noise is small beside the errors measured."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from deferred_ir.base.arrays import Array
from deferred_ir.base.errors import SettingError
from deferred_ir.base.files import write_json, write_whole
from deferred_ir.base.progress import ProgressBar
from deferred_ir.output.image import read_radiance
from deferred_ir.output.metadata import metadata_path, read_metadata
from deferred_ir.scene.scene import Scene
from deferred_ir.truth.metrics import relmse
from deferred_ir.truth.reference import reference

FILE = "reference.npy"
FIRST_SPP, MOST_SPP = 256, 4096
SHARE = 0.1
"""A reference's noise may be this much of an error that is held to it, else the row is flagged."""
MARGIN = 1.5
"""Errors of other seeds may be smaller than those that are looked at to choose the number of paths."""


@dataclass(frozen=True, eq=False)
class Truth:
    """radiance: (H, W, 3); record: what OUT.json says of it."""

    radiance: Array
    record: Mapping[str, Any]

    @property
    def hash(self) -> str:
        """First 16 hex digits of SHA-256 over the image as float32."""
        return hashlib.sha256(np.ascontiguousarray(self.radiance, np.float32).tobytes()).hexdigest()[:16]

    @property
    def hit(self) -> float | None:
        """Fraction of the pixels that show a surface."""
        return self.record.get("hit_fraction") or None

    @property
    def noise(self) -> float | None:
        """relMSE of its own noise; None where it is unknown."""
        value = self.record.get("noise")
        return float(value) if isinstance(value, int | float) and not isinstance(value, bool) else None


def read(path: Path, scene: Scene, size: tuple[int, int], time: float = 0.0) -> Truth:
    """The reference at `path`, held by its record against scene, size and time; SettingError if they differ."""
    radiance = read_radiance(path)
    height, width, _ = radiance.shape
    if (width, height) != size:
        raise SettingError(
            f"{path}: is {width}x{height}, but the sweep is {size[0]}x{size[1]}; give --size {width}x{height}"
        )
    record = read_metadata(path, size)
    if not record:
        raise SettingError(
            f"{path}: has no record {metadata_path(path).name} beside it; make it by: deferred-ir reference"
        )
    if record["scene_hash"] != scene.hash:
        raise SettingError(
            f"{path}: shows the scene {record.get('scene')} ({record['scene_hash']}), but the sweep is of {scene.name} "
            f"({scene.hash}); make one by: deferred-ir reference"
        )
    if scene.moves and record.get("time") != time:
        raise SettingError(
            f"{path}: shows the scene at {record.get('time', 0.0)} s, but the sweep's frames end at {time} s; give "
            f"--time {record.get('time', 0.0)}"
        )
    return Truth(radiance, record)


def load_or_trace(
    folder: Path,
    scene: Scene,
    size: tuple[int, int],
    sweep: Mapping[str, Any],
    *,
    images: Callable[[], Sequence[Array]],
    bar: ProgressBar,
) -> Truth:
    """The reference kept in `folder`, or a new one: paths are doubled until its noise is a tenth of the errors.

    sweep: what decides how good it has to be; kept in the record, so that a sweep that goes on needs no second look.
    images: renders the images whose error is likely to be the smallest. bar: shows how
    far the paths are.
    """
    bounces = int(scene.render.set.get("vpl.bounces", 1))
    truth = _kept(folder, scene, size, bounces)
    if truth and truth.record.get("sweep") == sweep:
        return truth
    if truth is None:
        truth = _traced(scene, size, FIRST_SPP, bounces, seed=0, bar=bar)
        _save(folder, truth)
    best = images()
    while True:
        smallest = min(relmse(image, truth.radiance, truth.hit)[0] for image in best)
        spp = int(truth.record["spp"])
        if (truth.noise or 0.0) * MARGIN <= SHARE * smallest or 2 * spp > MOST_SPP:
            break
        # As many paths again; all seeds before were smaller.
        truth = _mean(truth, _traced(scene, size, spp, bounces, seed=spp, bar=bar))
        _save(folder, truth)
    truth = Truth(truth.radiance, {**truth.record, "sweep": dict(sweep)})
    _save(folder, truth)
    return truth


def _traced(scene: Scene, size: tuple[int, int], spp: int, bounces: int, *, seed: int, bar: ProgressBar) -> Truth:
    bar.label(f"reference, {spp} paths")
    found = reference(scene, size, spp=spp, bounces=bounces, seed=seed, progress=bar.show)
    return Truth(found.radiance, found.meta)


def _mean(first: Truth, second: Truth) -> Truth:
    """The mean of two independent images of as many paths, whose variances add."""
    a, b = first.record, second.record
    radiance = (0.5 * (first.radiance.astype(np.float64) + second.radiance)).astype(np.float32)
    told = {
        "spp": a["spp"] + b["spp"],
        "standard_error": float(np.hypot(a["standard_error"], b["standard_error"]) / 2),
        "noise": (a["noise"] + b["noise"]) / 4,
        "seconds": a["seconds"] + b["seconds"],
    }
    return Truth(radiance, {**a, **told})


def _save(folder: Path, truth: Truth) -> None:
    file = folder / FILE

    def fill(part: Path) -> None:
        with part.open("wb") as stream:
            np.save(stream, np.asarray(truth.radiance, np.float32))
        write_json(metadata_path(file), {**truth.record, "image_hash": truth.hash})

    write_whole(file, fill)


def _kept(folder: Path, scene: Scene, size: tuple[int, int], bounces: int) -> Truth | None:
    """What an earlier run left, if it is whole and of this scene, size and number of bounces."""
    file = folder / FILE
    try:
        radiance = read_radiance(file)
        record = read_metadata(file, size)
    except SettingError:
        return None  # it is traced again
    truth = Truth(radiance, record)
    usable = record.get("scene_hash") == scene.hash and record.get("bounces") == bounces
    return truth if usable and record.get("image_hash") == truth.hash else None
