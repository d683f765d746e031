"""The reference of a sweep: a file, or one traced until its noise is small beside the errors measured."""

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
from deferred_ir.truth import reference_noise
from deferred_ir.truth.metrics import relmse
from deferred_ir.truth.reference import trace_reference
from deferred_ir.truth.reference_noise import ReferenceNoise

FILE = "reference.npy"
FIRST_SPP, MOST_SPP = 256, 4096
MARGIN = 1.5
"""Safety factor: errors of other seeds may be smaller than those that decide the number of paths."""


@dataclass(frozen=True)
class About:
    """What a report says of a reference. file: as the command names it, FILE for that of the sweep's folder.

    made: "256 paths a pixel".
    """

    file: str
    made: str
    noise: ReferenceNoise


@dataclass(frozen=True, eq=False)
class Truth:
    """A reference image. radiance: (H, W, 3). metadata: those of its JSON file. file: as the command names it."""

    radiance: Array
    metadata: Mapping[str, Any]
    file: str = FILE

    @property
    def hash(self) -> str:
        """First 16 hex digits of SHA-256 over the image as float32."""
        return hashlib.sha256(np.ascontiguousarray(self.radiance, np.float32).tobytes()).hexdigest()[:16]

    @property
    def hit(self) -> float | None:
        """Fraction of the pixels that show a surface."""
        return self.metadata.get("hit_fraction") or None

    @property
    def noise(self) -> ReferenceNoise:
        """How large an error it has itself."""
        return ReferenceNoise.from_metadata(self.metadata)

    @property
    def about(self) -> About:
        """What a report says of it."""
        counts = (("spp", "paths a pixel"), ("vpls", "VPLs with visibility by rays"))
        made = [f"{self.metadata[key]} {what}" for key, what in counts if self.metadata.get(key)]
        return About(self.file, ", ".join(made) or "its metadata do not say how it was made", self.noise)


def read(path: Path, scene: Scene, size: tuple[int, int], time: float = 0.0) -> Truth:
    """Read the reference at `path`. Raises SettingError if its scene, size or time differ from the sweep's."""
    radiance = read_radiance(path)
    height, width, _ = radiance.shape
    if (width, height) != size:
        raise SettingError(
            f"{path}: is {width}x{height}, but the sweep is {size[0]}x{size[1]}; give --size {width}x{height}"
        )
    metadata = read_metadata(path, size)
    if not metadata:
        raise SettingError(
            f"{path}: has no metadata file {metadata_path(path).name} beside it; make it by: deferred-ir reference"
        )
    if metadata["scene_hash"] != scene.hash:
        raise SettingError(
            f"{path}: shows the scene {metadata.get('scene')} ({metadata['scene_hash']}), but the sweep is of "
            f"{scene.name} ({scene.hash}); make one by: deferred-ir reference"
        )
    if scene.moves and metadata.get("time") != time:
        raise SettingError(
            f"{path}: shows the scene at {metadata.get('time', 0.0)} s, but the sweep's frames end at {time} s; give "
            f"--time {metadata.get('time', 0.0)}"
        )
    return Truth(radiance, metadata, str(path))


def load(folder: Path, scene: Scene, size: tuple[int, int], sweep: Mapping[str, Any]) -> Truth | None:
    """Load the reference in `folder` if it was found good enough for `sweep`, see `load_or_trace`."""
    truth = _load(folder, scene, size, find_bounces(scene))
    return truth if truth and truth.metadata.get("sweep") == sweep else None


def load_or_trace(
    folder: Path,
    scene: Scene,
    size: tuple[int, int],
    sweep: Mapping[str, Any],
    *,
    most_spp: int = MOST_SPP,
    images: Callable[[], Sequence[Array]],
    bar: ProgressBar,
) -> Truth:
    """Load the reference in `folder`, or trace one: paths are doubled until its noise is a tenth of the errors.

    sweep: identifies the images that decide how good it has to be; it is saved with the reference, which is used as it
    is if the next run names the same. most_spp: paths a pixel at most. images: renders those images, whose errors are
    likely to be the smallest. bar: shows how far the paths are.
    """
    bounces = find_bounces(scene)
    truth = _load(folder, scene, size, bounces)
    if truth and truth.metadata.get("sweep") == sweep:
        return truth
    if truth is None:
        truth = _trace(scene, size, FIRST_SPP, bounces, seed=0, bar=bar)
        _save(folder, truth)
    probes = images()
    while True:
        smallest = min(relmse(image, truth.radiance, truth.hit)[0] for image in probes)
        spp = int(truth.metadata["spp"])
        if (truth.noise.relmse or 0.0) * MARGIN <= reference_noise.MOST * smallest or 2 * spp > most_spp:
            break
        # Double the paths. The seed is new: all seeds before were smaller.
        truth = _mean(truth, _trace(scene, size, spp, bounces, seed=spp, bar=bar))
        _save(folder, truth)
    truth = Truth(truth.radiance, {**truth.metadata, "sweep": dict(sweep)})
    _save(folder, truth)
    return truth


def find_bounces(scene: Scene) -> int:
    """Return the bounces of indirect light that the scene file asks for, 1 unless it does."""
    return int(scene.render.set.get("vpl.bounces", 1))


def _trace(scene: Scene, size: tuple[int, int], spp: int, bounces: int, *, seed: int, bar: ProgressBar) -> Truth:
    bar.label(f"reference, {spp} paths")
    traced = trace_reference(scene, size, spp=spp, bounces=bounces, seed=seed, progress=bar.show)
    return Truth(traced.radiance, traced.meta)


def _mean(first: Truth, second: Truth) -> Truth:
    """Return the mean of two independent images with the same number of paths; their variances add."""
    a, b = first.metadata, second.metadata
    radiance = (0.5 * (first.radiance.astype(np.float64) + second.radiance)).astype(np.float32)
    summed = {
        "spp": a["spp"] + b["spp"],
        "standard_error": float(np.hypot(a["standard_error"], b["standard_error"]) / 2),
        "noise": (a["noise"] + b["noise"]) / 4,
        "seconds": a["seconds"] + b["seconds"],
    }
    return Truth(radiance, {**a, **summed})


def _save(folder: Path, truth: Truth) -> None:
    file = folder / FILE

    def fill(part: Path) -> None:
        with part.open("wb") as stream:
            np.save(stream, np.asarray(truth.radiance, np.float32))
        write_json(metadata_path(file), {**truth.metadata, "image_hash": truth.hash})

    write_whole(file, fill)


def _load(folder: Path, scene: Scene, size: tuple[int, int], bounces: int) -> Truth | None:
    """Load the reference of an earlier run. Returns None unless it is complete and of this scene, size and bounces."""
    file = folder / FILE
    try:
        radiance = read_radiance(file)
        metadata = read_metadata(file, size)
    except SettingError:
        return None  # it is traced again
    truth = Truth(radiance, metadata)
    usable = metadata.get("scene_hash") == scene.hash and metadata.get("bounces") == bounces
    return truth if usable and metadata.get("image_hash") == truth.hash else None
