"""The points of a sweep as files: one graph, one number of VPLs and one seed each, measured and held to a reference."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from statistics import median
from typing import Any

from deferred_ir.errors import OutputError, SettingError
from deferred_ir.image import write_whole
from deferred_ir.run_record import write

FOLDER = "points"
PICTURES = (".png", ".error.png")
"""What lies beside a point that has pictures: the image as the graph displays it, and its error in false colour."""


@dataclass(frozen=True)
class Key:
    """What a point depends on. `scene_hash`, `graph_hash`: 16 hex digits; size: [width, height]."""

    scene_hash: str
    graph_hash: str
    size: list[int]
    vpls: int
    seed: int

    @property
    def name(self) -> str:
        """16 hex digits, the same on every machine."""
        text = json.dumps(asdict(self), sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:16]


@dataclass(frozen=True)
class Point:
    """One measured point. Times in milliseconds, memory in bytes.

    reference: hash of the reference image; reference_noise: its own relMSE, None where it is unknown. device:
    GL_RENDERER; software: it is a driver without a GPU. frames: wall time of each recorded frame. laps: for each frame
    (pass, GPU, CPU) in the order in which they ran. pictures: the files of PICTURES lie beside it.
    """

    key: Key
    scene: str
    graph: str
    reference: str
    reference_noise: float | None
    device: str
    software: bool
    vpls_alive: int
    frames: list[float]
    laps: list[list[tuple[str, float, float]]]
    memory: dict[str, int]
    left_out: dict[str, str]
    relmse: float
    relmse_untrimmed: float
    bias: float
    flip: float | None
    flip_note: str | None
    flip_parameters: dict[str, Any] | None
    pictures: bool

    @property
    def frame_ms(self) -> float:
        """Median wall time of a frame."""
        return round(median(self.frames), 4)


def path(folder: Path, name: str, suffix: str = ".json") -> Path:
    """Where a file of the point `name` lies under the output folder."""
    return folder / FOLDER / f"{name}{suffix}"


def save(folder: Path, point: Point) -> None:
    """Write the point whole; its pictures have to be there by then."""
    write(path(folder, point.key.name), asdict(point))


def read(folder: Path, name: str) -> Point | None:
    """The point `name`, None if it is missing, half-written, or not what its name says."""
    try:
        data = json.loads(path(folder, name).read_text(encoding="utf-8"))
        laps = [[(str(label), float(gpu), float(cpu)) for label, gpu, cpu in frame] for frame in data["laps"]]
        if data.keys() != {f.name for f in fields(Point)} or not all(data["frames"]):
            return None
        point = Point(**{**data, "key": Key(**data["key"]), "laps": laps})
    except (OSError, ValueError, TypeError, KeyError, RecursionError):
        return None  # it is measured again
    there = all(path(folder, name, suffix).is_file() for suffix in PICTURES)
    return point if point.key.name == name and (there or not point.pictures) else None


def make_folder(folder: Path) -> None:
    """Create the output folder with room for points, or raise OutputError."""
    try:
        (folder / FOLDER).mkdir(parents=True, exist_ok=True)
        write_whole(folder / FOLDER / "probe", lambda part: part.touch())
        (folder / FOLDER / "probe").unlink()
    except (OSError, ValueError) as error:
        why = getattr(error, "strerror", None) or error
        raise OutputError(f"{folder}: cannot be written: {why}; choose another folder") from error


def merge(sources: Sequence[Path], target: Path) -> tuple[list[Point], int]:
    """Copy the points of several output folders to `target`; the points, sorted, and how many files were unusable.

    Raises SettingError where folders hold no points, or points of several scenes, sizes or references.
    """
    found: dict[str, tuple[Path, Point]] = {}
    broken = 0
    for source in sources:
        names = [file.stem for file in sorted((source / FOLDER).glob("*.json"))]
        read_here = {name: read(source, name) for name in names}
        broken += sum(point is None for point in read_here.values())
        points = {name: point for name, point in read_here.items() if point}
        if not points:
            raise SettingError(f"{source}: holds no points of a sweep; give folders that profile wrote")
        for name, point in points.items():
            _same(found, source, point)
            found.setdefault(name, (source, point))
    make_folder(target)
    for name, (source, point) in found.items():
        if source.resolve() == target.resolve():
            continue
        for suffix in PICTURES if point.pictures else ():
            _copy(path(source, name, suffix), path(target, name, suffix))
        save(target, point)
    return ordered(point for _, point in found.values()), broken


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


def ordered(points: Iterable[Point]) -> list[Point]:
    """By graph, number of VPLs and seed."""
    return sorted(points, key=lambda point: (point.graph, point.key.vpls, point.key.seed))


def renamed(point: Point, graph: str) -> Point:
    """The point under the name that the caller has for its graph."""
    return replace(point, graph=graph)
