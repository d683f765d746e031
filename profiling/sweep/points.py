"""The points of a sweep as files: one graph, one number of VPLs and one seed each, measured and held to a reference."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from statistics import median
from typing import Any

from deferred_ir.base.errors import OutputError
from deferred_ir.base.files import write_json, write_whole
from deferred_ir.report.left_out import LeftOut

FOLDER = "points"
PICTURES = (".png", ".error.png")
"""What lies beside a point that has pictures: the image as the graph displays it, and its error in false colour."""


@dataclass(frozen=True)
class Key:
    """What a point depends on. `scene_hash`, `graph_hash`: 16 hex digits; size: [width, height].

    scene_hash: of the scene at the time of its image. motion: where something moves, the hash of the scene.
    """

    scene_hash: str
    graph_hash: str
    size: list[int]
    vpls: int
    seed: int
    motion: str = ""

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
    (pass, GPU, CPU) in the order in which they ran. relmse_masked: of the pixels without an edge, None where there
    is no such pixel. time: of the last frame, where something moves, seconds. pictures: the files of PICTURES lie
    beside it.
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
    time: float | None
    left_out: list[LeftOut]
    relmse: float
    relmse_untrimmed: float
    bias: float
    relmse_masked: float | None
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
    write_json(path(folder, point.key.name), asdict(point))


def read(folder: Path, name: str) -> Point | None:
    """The point `name`, None if it is missing, half-written, or not what its name says."""
    try:
        data = json.loads(path(folder, name).read_text(encoding="utf-8"))
        laps = [[(str(label), float(gpu), float(cpu)) for label, gpu, cpu in frame] for frame in data["laps"]]
        left_out = [LeftOut(**entry) for entry in data["left_out"]]
        if data.keys() != {f.name for f in fields(Point)} or not all(data["frames"]):
            return None
        point = Point(**{**data, "key": Key(**data["key"]), "laps": laps, "left_out": left_out})
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


def ordered(points: Iterable[Point]) -> list[Point]:
    """By graph, number of VPLs and seed."""
    return sorted(points, key=lambda point: (point.graph, point.key.vpls, point.key.seed))


def renamed(point: Point, graph: str) -> Point:
    """The point under the name that the caller has for its graph."""
    return replace(point, graph=graph)
