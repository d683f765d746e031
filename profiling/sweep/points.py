"""The points of a sweep as files: one graph, number of VPLs and seed each, compared with a reference."""

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
from deferred_ir.profiling.sweep.reference import About
from deferred_ir.report.left_out import LeftOut
from deferred_ir.report.origin import Origin
from deferred_ir.truth.reference_noise import ReferenceNoise

FOLDER = "points"
PICTURES = (".png", ".error.png")
"""Files beside a point with pictures: the image as the graph displays it, and its error in false colour."""


@dataclass(frozen=True)
class Key:
    """Everything that a point depends on.

    scene_hash: 16 hex digits, of the scene at the time of the image. graph_hash: 16 hex digits. size: [width, height].
    motion: where something moves, the hash of the scene at all times.
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

    origin: the run that measured it. reference: hash of the reference image. device, driver: GL_RENDERER, GL_VERSION.
    software: whether that is a driver without a GPU. frames_to_fill: frames until state between frames is complete,
    before the measured frames; 1 for graphs without such state. retains_samples: whether images hold samples of earlier
    frames, so that the time of a frame is not that of an image. frames: wall time of each measured frame. laps: for
    each frame (pass, GPU, CPU) in the order in which the passes ran. relmse_masked: relMSE of the pixels without an
    edge, None if there is no such pixel. time: of the last frame, where something moves, seconds. pictures: whether the
    files of PICTURES lie beside the point.
    """

    key: Key
    scene: str
    graph: str
    origin: Origin
    reference: str
    reference_about: About
    device: str
    driver: str
    software: bool
    vpls_alive: int
    frames_to_fill: int
    retains_samples: bool
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
        """Median wall time of a frame, milliseconds."""
        return round(median(self.frames), 4)


def path(folder: Path, name: str, suffix: str = ".json") -> Path:
    """Return the path of a file of the point `name` in the output folder."""
    return folder / FOLDER / f"{name}{suffix}"


def save(folder: Path, point: Point) -> None:
    """Write the point. Its pictures have to be written before."""
    write_json(path(folder, point.key.name), asdict(point))


def read(folder: Path, name: str) -> Point | None:
    """Read the point `name`. Returns None if it is missing, incomplete, or not what its name says."""
    try:
        data = json.loads(path(folder, name).read_text(encoding="utf-8"))
        laps = [[(str(label), float(gpu), float(cpu)) for label, gpu, cpu in frame] for frame in data["laps"]]
        left_out = [LeftOut(**entry) for entry in data["left_out"]]
        if data.keys() != {f.name for f in fields(Point)} or not all(data["frames"]):
            return None
        about = data["reference_about"]
        about = About(**{**about, "noise": ReferenceNoise(**about["noise"])})
        parts = {"key": Key(**data["key"]), "origin": Origin(**data["origin"]), "reference_about": about}
        point = Point(**{**data, **parts, "laps": laps, "left_out": left_out})
    except (OSError, ValueError, TypeError, KeyError, RecursionError):
        return None  # the point is measured again
    complete = not point.pictures or all(path(folder, name, suffix).is_file() for suffix in PICTURES)
    return point if point.key.name == name and complete else None


def make_folder(folder: Path) -> None:
    """Create the output folder and its folder of points. Raises OutputError."""
    try:
        (folder / FOLDER).mkdir(parents=True, exist_ok=True)
        write_whole(folder / FOLDER / "probe", lambda part: part.touch())
        (folder / FOLDER / "probe").unlink()
    except (OSError, ValueError) as error:
        why = getattr(error, "strerror", None) or error
        raise OutputError(f"{folder}: cannot be written: {why}; choose another folder") from error


def sort(points: Iterable[Point]) -> list[Point]:
    """Sort points by graph, number of VPLs and seed."""
    return sorted(points, key=lambda point: (point.graph, point.key.vpls, point.key.seed))


def rename(point: Point, graph: str) -> Point:
    """Return the point with the caller's name for its graph."""
    return replace(point, graph=graph)
