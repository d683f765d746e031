"""Joining the folders of shards: points, what was measured of peers, and the mask."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from deferred_ir.base.errors import SettingError
from deferred_ir.base.files import write_whole
from deferred_ir.profiling.peers import points as peer_points
from deferred_ir.profiling.peers.points import Peers
from deferred_ir.profiling.sweep import edge_mask, points
from deferred_ir.profiling.sweep.points import Point


def merge(sources: Sequence[Path], target: Path) -> tuple[list[Point], Peers, int]:
    """Copy what several output folders hold to `target`; its points and peers, and how many files were unusable.

    Raises SettingError where folders hold no points, or points of several scenes, sizes or references.
    """
    found: dict[str, tuple[Path, Point]] = {}
    broken = 0
    for source in sources:
        names = [file.stem for file in sorted((source / points.FOLDER).glob("*.json"))]
        read_here = {name: points.read(source, name) for name in names}
        broken += sum(point is None for point in read_here.values())
        usable = {name: point for name, point in read_here.items() if point}
        if not usable:
            raise SettingError(f"{source}: holds no points of a sweep; give folders that profile wrote")
        for name, point in usable.items():
            _same(found, source, point)
            found.setdefault(name, (source, point))
    points.make_folder(target)
    for name, (source, point) in found.items():
        if source.resolve() == target.resolve():
            continue
        for suffix in points.PICTURES if point.pictures else ():
            _copy(points.path(source, name, suffix), points.path(target, name, suffix))
        points.save(target, point)
    first = next(iter(found.values()))[1]
    scene_hash, size = first.key.scene_hash, first.key.size
    masks = (edge_mask.read(source, scene_hash, (size[0], size[1])) for source in sources)
    mask = next((mask for mask in masks if mask), None)
    if mask:
        edge_mask.save(target, mask, scene_hash)
    peers, others = peer_points.merge(sources, target, scene_hash=scene_hash, size=size, reference=first.reference)
    return points.ordered(point for _, point in found.values()), peers, broken + others


def _same(found: dict[str, tuple[Path, Point]], source: Path, point: Point) -> None:
    if not found:
        return
    other, first = next(iter(found.values()))
    for what, ours, theirs in (
        ("scene", (point.scene, point.key.scene_hash), (first.scene, first.key.scene_hash)),
        ("size", tuple(point.key.size), tuple(first.key.size)),
        ("reference", (point.reference,), (first.reference,)),
    ):
        if ours != theirs:
            told = [" ".join(map(str, values)) for values in (ours, theirs)]
            mend = "give all shards the same --reference" if what == "reference" else "merge them apart"
            raise SettingError(f"{source}: {what}: is {told[0]}, but {told[1]} in {other}; {mend}")


def _copy(source: Path, target: Path) -> None:
    data = source.read_bytes()

    def fill(part: Path) -> None:
        part.write_bytes(data)

    write_whole(target, fill)
