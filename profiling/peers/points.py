"""Points of peers as files: one peer, number of paths a pixel and seed each; and notes on why points are missing."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path

from deferred_ir.base.errors import OutputError
from deferred_ir.base.files import write_json
from deferred_ir.profiling.peers.peer import NAMES
from deferred_ir.report.origin import Origin

FOLDER = "peers"
NOTES = "notes.json"


@dataclass(frozen=True)
class PeerKey:
    """Everything that a point depends on. size: [width, height]. spp: paths a pixel."""

    scene_hash: str
    size: list[int]
    bounces: int
    peer: str
    spp: int
    seed: int

    @property
    def name(self) -> str:
        """16 hex digits, the same on every machine."""
        return hashlib.sha256(json.dumps(asdict(self), sort_keys=True).encode()).hexdigest()[:16]


@dataclass(frozen=True)
class PeerPoint:
    """One image of a peer. about: its version. origin: the run that measured it. ms: wall time.

    reference, mask: hashes of what it was compared with.

    relmse, relmse_untrimmed and bias are over all pixels that show a surface, so they include the difference between a
    pixel's mean and its centre. relmse_masked is over the pixels without an edge, None if there are none.
    """

    key: PeerKey
    about: str
    origin: Origin
    reference: str
    mask: str
    ms: float
    relmse: float
    relmse_untrimmed: float
    bias: float
    relmse_masked: float | None


@dataclass(frozen=True)
class Peers:
    """Points in order, and notes on peers without points or with missing ones."""

    points: Sequence[PeerPoint] = ()
    notes: Mapping[str, str] = field(default_factory=dict)


def path(folder: Path, key: PeerKey) -> Path:
    """Return the path of a point in the output folder."""
    return folder / FOLDER / f"{key.name}.json"


def save(folder: Path, point: PeerPoint) -> None:
    """Write the point."""
    write_json(path(folder, point.key), asdict(point))


def read(file: Path) -> PeerPoint | None:
    """Read the point in `file`. Returns None if it is missing, incomplete, or not what its name says."""
    try:
        data = json.loads(file.read_text(encoding="utf-8"))
        if data.keys() != {f.name for f in fields(PeerPoint)} or not data["ms"] > 0:
            return None
        point = PeerPoint(**{**data, "key": PeerKey(**data["key"]), "origin": Origin(**data["origin"])})
    except (OSError, ValueError, TypeError, KeyError, AttributeError, RecursionError):
        return None  # the point is measured again
    return point if point.key.name == file.stem else None


def make_folder(folder: Path) -> Path:
    """Create the folder of peers' points if it is missing. Returns it; raises OutputError."""
    try:
        (folder / FOLDER).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"{folder / FOLDER}: cannot be written: {error.strerror}; choose another folder") from error
    return folder / FOLDER


def save_notes(folder: Path, notes: Mapping[str, str]) -> None:
    """Save the notes for the report of a merge."""
    write_json(make_folder(folder) / NOTES, dict(notes))


def merge(
    sources: Sequence[Path], target: Path, *, scene_hash: str, size: Sequence[int], reference: str
) -> tuple[Peers, int]:
    """Copy peers' points and notes to `target`. Returns them, and the number of files unusable or of another sweep."""
    points: dict[str, PeerPoint] = {}
    notes: dict[str, str] = {}
    broken = 0
    for source in sources:
        for file in sorted((source / FOLDER).glob("*.json")):
            if file.name == NOTES:
                notes = {**_notes(file), **notes}
                continue
            point = read(file)
            wanted = scene_hash, list(size), reference
            if point and (point.key.scene_hash, list(point.key.size), point.reference) == wanted:
                points.setdefault(point.key.name, point)
            else:
                broken += 1
    if points or notes:
        save_notes(target, notes)
    for point in points.values():
        save(target, point)
    return Peers(sort(points.values()), notes), broken


def _notes(file: Path) -> dict[str, str]:
    try:
        data = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return {}  # a note alone, and the next run writes it again
    return {name: str(data[name]) for name in NAMES if name in data} if isinstance(data, dict) else {}


def sort(points: Iterable[PeerPoint]) -> list[PeerPoint]:
    """Sort points by peer, number of paths and seed."""
    return sorted(points, key=lambda point: (NAMES.index(point.key.peer), point.key.spp, point.key.seed))
