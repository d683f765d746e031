"""Measuring peers on a ladder of 1, 2, 4, ... paths a pixel: time and error of each rung, saved once measured."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from statistics import mean

from deferred_ir.base.errors import Error, SettingError, did_you_mean
from deferred_ir.base.progress import progress_bar
from deferred_ir.profiling.peers import points as peer_points
from deferred_ir.profiling.peers import process as peer_process
from deferred_ir.profiling.peers.peer import NAMES
from deferred_ir.profiling.peers.points import PeerKey, PeerPoint, Peers
from deferred_ir.profiling.sweep.edge_mask import Mask
from deferred_ir.profiling.sweep.equal_error import TARGETS
from deferred_ir.profiling.sweep.reference import Truth, find_bounces
from deferred_ir.report.origin import Origin
from deferred_ir.scene.scene import Scene
from deferred_ir.truth import metrics

ENOUGH = min(TARGETS) / 1.5
"""The ladder ends below this error, so that the smallest target lies between two rungs, or where noise hides more."""
BUDGET = 90e3
"""Milliseconds of rendering for all rungs of a peer; a rung that would exceed it is not started."""
QUICK = 5e3
"""Milliseconds: a rung is measured with all seeds if that is likely to take less, else with the first."""
MOST_SPP = 1 << 14
STALLED, STALLS = 0.95, 2
"""The ladder also ends after STALLS rungs in a row with more than STALLED times the error of the one before."""


@dataclass(frozen=True, eq=False)
class Course:
    """What all peers render and are compared with. size: (width, height)."""

    scene: Scene
    size: tuple[int, int]
    seeds: int
    truth: Truth
    mask: Mask
    origin: Origin

    @property
    def bounces(self) -> int:
        """Bounces of indirect light."""
        return find_bounces(self.scene)

    def key(self, peer: str, spp: int, seed: int) -> PeerKey:
        """Return the key of a point."""
        return PeerKey(self.scene.hash, list(self.size), self.bounces, peer, spp, seed)


def choose(text: str | None) -> Sequence[str]:
    """Return the peers of `--peers A,B|none`, all without it. Raises SettingError for an unknown name."""
    if text is None:
        return NAMES
    names = list(dict.fromkeys(name for part in text.split(",") if (name := part.strip())))
    if names == ["none"]:
        return ()
    for name in names:
        if name == "none":
            raise SettingError(f"--peers {text}: 'none' stands alone; leave it out, or the others")
        if name not in NAMES:
            raise SettingError(f"--peers {text}: no peer '{name}'{did_you_mean(name, NAMES)}")
    if not names:
        raise SettingError("--peers: names nothing; write --peers none to leave them out")
    return names


def run(course: Course, folder: Path, names: Sequence[str]) -> Peers:
    """Measure what is not in `folder` yet. A peer that is missing or fails gets a note, also on standard error."""
    points: list[PeerPoint] = []
    notes: dict[str, str] = {}
    for name in names:
        missing = peer_process.module(name).available()
        if missing:
            notes[name] = f"{missing}; pip install {peer_process.module(name).INSTALL}"
        else:
            try:
                for point in _measure(course, folder, name):
                    points.append(point)
            except Error as error:
                notes[name] = str(error)
        if name in notes:
            print(f"note: peer {name}: {notes[name]}", file=sys.stderr)
    if names:
        peer_points.save_notes(folder, notes)
    return Peers(peer_points.sort(points), notes)


def _measure(course: Course, folder: Path, name: str) -> Iterator[PeerPoint]:
    """Yield the points of one peer. Its process starts for the first point that is not on disk."""
    log = peer_points.make_folder(folder) / f"{name}.log"
    with (
        ExitStack() as stack,
        progress_bar(total=BUDGET / 1e3, unit="second", at_most=True) as bar,
    ):
        process: peer_process.PeerProcess | None = None

        def measure(spp: int, seed: int) -> PeerPoint:
            nonlocal process
            key = course.key(name, spp, seed)
            point = peer_points.read(peer_points.path(folder, key))
            if point is None or (point.reference, point.mask) != (course.truth.hash, course.mask.hash):
                bar.label(f"{name}, {spp} paths, seed {seed}")
                if process is None:
                    process = stack.enter_context(
                        peer_process.PeerProcess(name, course.scene, course.size, course.bounces, log)
                    )
                point = _render_point(course, key, process)
                peer_points.save(folder, point)
            bar.advance(point.ms / 1e3)
            return point

        yield from climb(measure, course.seeds, course.truth.noise.level(ENOUGH))


def climb(measure: Callable[[int, int], PeerPoint], seeds: int, enough: float) -> Iterator[PeerPoint]:
    """Yield points of `measure(spp, seed)` until the error is `enough` or stalls, or the time is used up."""
    spent, ahead, spp = 0.0, 0.0, 1
    last, stalls = math.inf, 0
    while spp <= MOST_SPP and spent + ahead <= BUDGET and stalls < STALLS:
        rung = []
        for seed in range(seeds if ahead * seeds <= QUICK else 1):
            rung.append(measure(spp, seed))
            yield rung[-1]
        spent += sum(point.ms for point in rung)
        ahead = 2 * mean(point.ms for point in rung)
        errors = [point.relmse_masked for point in rung if point.relmse_masked is not None]
        if not errors or mean(errors) <= enough:
            return
        stalls = stalls + 1 if mean(errors) > STALLED * last else 0
        last = mean(errors)
        spp *= 2


def _render_point(course: Course, key: PeerKey, process: peer_process.PeerProcess) -> PeerPoint:
    rendered = process.render(key.spp, key.seed)
    image, truth = rendered.radiance, course.truth
    trimmed, untrimmed = metrics.relmse(image, truth.radiance, truth.hit)
    return PeerPoint(
        key=key,
        about=process.about,
        origin=course.origin,
        reference=truth.hash,
        mask=course.mask.hash,
        ms=round(rendered.ms, 4),
        relmse=trimmed,
        relmse_untrimmed=untrimmed,
        bias=metrics.bias(image, truth.radiance, truth.hit),
        relmse_masked=metrics.masked_relmse(image, truth.radiance, course.mask.counts),
    )
