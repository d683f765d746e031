"""Joining the folders of shards: points, points of peers, and the mask."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from deferred_ir.base.errors import SettingError
from deferred_ir.base.files import write_whole
from deferred_ir.profiling.peers import points as peer_points
from deferred_ir.profiling.sweep import edge_mask, points
from deferred_ir.profiling.sweep.edge_mask import Mask
from deferred_ir.profiling.sweep.points import Point
from deferred_ir.profiling.sweep.run import Results


def merge(sources: Sequence[Path], target: Path) -> tuple[Results, int]:
    """Copy the results in several output folders to `target`. Returns them, and how many files were unusable.

    Raises SettingError for a folder without points, and for points of different scenes, sizes or references.
    """
    merged: dict[str, tuple[Path, Point]] = {}
    broken = 0
    for source in sources:
        files = sorted((source / points.FOLDER).glob("*.json"))
        usable = [point for file in files if (point := points.read(source, file.stem))]
        broken += len(files) - len(usable)
        if not usable:
            raise SettingError(f"{source}: holds no points of a sweep; give folders that profile wrote")
        for point in usable:
            if merged:
                _check_same_sweep(source, point, *next(iter(merged.values())))
            merged.setdefault(point.key.name, (source, point))
    points.make_folder(target)
    for name, (source, point) in merged.items():
        if source.resolve() == target.resolve():
            continue
        for suffix in points.PICTURES if point.pictures else ():
            _copy(points.path(source, name, suffix), points.path(target, name, suffix))
        points.save(target, point)
    first = next(iter(merged.values()))[1]
    scene_hash, (width, height) = first.key.scene_hash, first.key.size
    mask = _merge_masks(sources, target, scene_hash, (width, height))
    peers, others = peer_points.merge(
        sources, target, scene_hash=scene_hash, size=(width, height), reference=first.reference
    )
    return Results(points.sort(point for _, point in merged.values()), peers, mask), broken + others


def _merge_masks(sources: Sequence[Path], target: Path, scene_hash: str, size: tuple[int, int]) -> Mask | None:
    """Copy the first mask that a folder holds, if any."""
    masks = (edge_mask.read(source, scene_hash, size) for source in sources)
    mask = next((mask for mask in masks if mask), None)
    if mask:
        edge_mask.save(target, mask, scene_hash)
    return mask


def _check_same_sweep(source: Path, point: Point, other: Path, first: Point) -> None:
    """Raise SettingError if two points, each with its folder, are not of the same sweep."""
    for what, ours, theirs in (
        ("scene", (point.scene, point.key.scene_hash), (first.scene, first.key.scene_hash)),
        ("size", tuple(point.key.size), tuple(first.key.size)),
        ("reference", (point.reference,), (first.reference,)),
    ):
        if ours != theirs:
            here, there = (" ".join(map(str, values)) for values in (ours, theirs))
            mend = "give all shards the same --reference" if what == "reference" else "merge them apart"
            raise SettingError(f"{source}: {what}: is {here}, but {there} in {other}; {mend}")


def _copy(source: Path, target: Path) -> None:
    data = source.read_bytes()

    def fill(part: Path) -> None:
        part.write_bytes(data)

    write_whole(target, fill)
