"""Find pixels with an edge inside, to leave them out where renderers with different pixel filters are compared.

Our pixel is the radiance at its centre, a path tracer's is the mean over its area. Both agree as long as nothing within
the pixel jumps. So rays are traced through a lattice over each pixel, its border included, and a pixel is left out for
all renderers if two neighbours of the lattice differ in surface, albedo, or in which lights reach them.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from deferred_ir.base.arrays import Array, Bools
from deferred_ir.base.errors import SettingError
from deferred_ir.base.files import write_json, write_whole
from deferred_ir.base.progress import Progress
from deferred_ir.output.image import Image
from deferred_ir.output.metadata import metadata_path, read_metadata
from deferred_ir.rays.tracer import Hits, Tracer
from deferred_ir.scene.scene import Scene

FILE, PICTURE = "mask.npy", "mask.png"
STEPS = 4
"""Steps of the lattice along a pixel's edge."""
BEND = np.radians(6.0)
"""Largest angle between neighbours' normals on one surface, and between the line through them and their planes."""
JUMP = 0.05
"""Largest difference of neighbours' albedos, as a fraction of the larger one."""
ROWS = 16
"""Rows of pixels that are processed together; limits memory."""


@dataclass(frozen=True, eq=False)
class Mask:
    """The pixels that count. counts: bool (H, W), top row first: one surface, all lit by the same lights."""

    counts: Bools

    @property
    def left_out(self) -> float:
        """The fraction of the pixels that do not count."""
        return 1.0 - float(self.counts.mean())

    @property
    def hash(self) -> str:
        """First 16 hex digits of SHA-256 over the pixels."""
        return hashlib.sha256(np.packbits(self.counts).tobytes()).hexdigest()[:16]


@dataclass(frozen=True, eq=False)
class _Lattice:
    """Hits of the rays through a lattice, all (rows, columns, ...): position, geometric and shading normal, albedo.

    material: -1 where a ray hits nothing. lit: which direct lights reach the point, a number for each set of them.
    """

    position: Array
    normal: Array
    shading: Array
    albedo: Array
    material: Any
    lit: Any

    def crop(self, rows: slice, columns: slice) -> _Lattice:
        return _Lattice(*(value[rows, columns] for value in vars(self).values()))


def find(scene: Scene, size: tuple[int, int], progress: Progress | None = None) -> Mask:
    """Find the mask of `scene` at time 0 for images of `size` (width, height). Raises DeviceError without embreex."""
    scene = scene.at(0.0)
    tracer = Tracer(scene)
    blocks = []
    for row in range(0, size[1], ROWS):
        blocks.append(_find_whole(_trace(scene, tracer, size, row, min(row + ROWS, size[1]))))
        if progress:
            progress(min(row + ROWS, size[1]), size[1])
    return Mask(np.concatenate(blocks))


def _trace(scene: Scene, tracer: Tracer, size: tuple[int, int], first: int, last: int) -> _Lattice:
    """Trace the lattice over the rows of pixels `first` to `last` - 1."""
    width, height = size
    a, b, c = scene.camera.ray_axes(size)
    x = np.arange(STEPS * width + 1) / (STEPS * width) * 2 - 1
    y = 1 - np.arange(STEPS * first, STEPS * last + 1) / (STEPS * height) * 2
    shape = len(y), len(x)
    directions = (x[None, :, None] * a + y[:, None, None] * b + c).reshape(-1, 3)
    hits = tracer.closest(np.broadcast_to(np.asarray(scene.camera.position, float), directions.shape), directions)
    material = np.where(hits.hit, scene.geometry.face_materials[hits.face], -1)

    lit = _find_lit(scene, tracer, hits)
    values: tuple[Any, ...] = (hits.position, hits.normal, hits.shading_normal, hits.albedo, material, lit)
    return _Lattice(*(value.reshape(*shape, *value.shape[1:]) for value in values))


def _find_lit(scene: Scene, tracer: Tracer, hits: Hits) -> Any:
    """Return a number for the set of direct lights that reach each hit, uint64 (n,).

    Lights with a radius count by their middles: their penumbrae may be narrower than a pixel. Areas and environments
    do not count. Each light has a random number, and those of a set are combined (Zobrist 1970): any number of lights.
    """
    lit = np.zeros(len(hits.face), np.uint64)
    names = np.random.default_rng(0).integers(1 << 63, size=len(scene.direct_lights), dtype=np.uint64)
    for light, name in zip(scene.direct_lights, names, strict=True):
        if not any(light.emission):
            continue
        found = light.sample(hits.position, None, scene.bounds)
        rows = np.flatnonzero(hits.hit & (np.einsum("ij,ij->i", found.to, hits.normal) > 0) & (found.strength > 0))
        starts = tracer.lift(hits.position[rows], hits.normal[rows])
        lit[rows[~tracer.occluded(starts, found.ends[rows])]] ^= name
    return lit


def _find_whole(lattice: _Lattice) -> Bools:
    """Return the pixels of these rows without an edge inside, bool (rows, W)."""
    everything = slice(None)
    across = _differ(lattice.crop(everything, slice(-1)), lattice.crop(everything, slice(1, None)))
    down = _differ(lattice.crop(slice(-1), everything), lattice.crop(slice(1, None), everything))
    nothing = lattice.material < 0
    # Steps along the lines of a pixel's lattice and between them; the lines on its border are its neighbour's as well.
    edges = _any(across, STEPS + 1, STEPS) | _any(down, STEPS, STEPS + 1) | _any(nothing, STEPS + 1, STEPS + 1)
    return ~edges


def _any(flags: Bools, tall: int, wide: int) -> Bools:
    """Return whether any of the `tall` x `wide` flags of each pixel is set; pixels are STEPS apart."""
    blocks: Any = np.lib.stride_tricks.sliding_window_view(flags, (tall, wide))[::STEPS, ::STEPS]
    result: Bools = blocks.any(axis=(-1, -2))
    return result


def _differ(one: _Lattice, other: _Lattice) -> Bools:
    """Return where an edge lies between two points of the lattice."""
    way = other.position - one.position
    length = np.linalg.norm(way, axis=-1)
    off_plane = np.maximum(np.abs((way * one.normal).sum(-1)), np.abs((way * other.normal).sum(-1)))
    bent = (one.shading * other.shading).sum(-1) < np.cos(BEND)
    folded = (one.normal * other.normal).sum(-1) < np.cos(BEND)
    jump = np.abs(one.albedo - other.albedo) > JUMP * np.maximum(one.albedo, other.albedo)
    differ: Bools = (
        (one.material != other.material)
        | (one.lit != other.lit)
        | jump.any(axis=-1)
        | bent
        | folded
        | (off_plane > np.sin(BEND) * length)
    )
    return differ


def load_or_find(folder: Path, scene: Scene, size: tuple[int, int], progress: Progress | None = None) -> Mask:
    """Load the mask in `folder`, or find it and save it there."""
    mask = read(folder, scene.hash, size)
    if mask is None:
        mask = find(scene, size, progress)
        save(folder, mask, scene.hash)
    return mask


def save(folder: Path, mask: Mask, scene_hash: str) -> None:
    """Write the mask, a picture of it (white pixels count) and its metadata; each file appears whole or not at all."""
    height, width = mask.counts.shape
    metadata = {"scene_hash": scene_hash, "size": [width, height], "left_out": mask.left_out, "image_hash": mask.hash}
    Image(None, np.repeat(np.where(mask.counts, 255, 0).astype(np.uint8)[..., None], 3, axis=2)).save(folder / PICTURE)

    def fill(part: Path) -> None:
        with part.open("wb") as file:
            np.save(file, mask.counts)
        write_json(metadata_path(folder / FILE), metadata)

    write_whole(folder / FILE, fill)


def read(folder: Path, scene_hash: str, size: tuple[int, int]) -> Mask | None:
    """Load the mask of an earlier run. Returns None unless it is complete and of this scene and size."""
    file = folder / FILE
    try:
        with file.open("rb") as stream:
            counts = np.load(stream)
        metadata = read_metadata(file, size)
    except (OSError, ValueError, EOFError, SettingError):
        return None  # it is made again
    if counts.dtype != np.bool_ or counts.shape != (size[1], size[0]) or not (folder / PICTURE).is_file():
        return None
    mask = Mask(counts)
    whole = metadata.get("scene_hash") == scene_hash and metadata.get("image_hash") == mask.hash
    return mask if whole else None
