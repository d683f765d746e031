"""What the frames of a run took, and the medians that RUN.json and the profiler report."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from statistics import median


@dataclass
class Measurement:
    """Times, counters and skipped passes of repeated frames, an entry a frame.

    frame_ms: wall time in milliseconds. laps: by pass, (GPU, CPU) milliseconds. skipped: names of the passes that did
    not run, because their outputs still held what they would have written.
    """

    frame_ms: list[float] = field(default_factory=list)
    laps: list[dict[str, tuple[float, float]]] = field(default_factory=list)
    counters: list[dict[str, int]] = field(default_factory=list)
    skipped: list[tuple[str, ...]] = field(default_factory=list)

    def add_frame(self, parts: Measurement) -> None:
        """Add one frame that was drawn in parts: times are added up, counters stay those of each part."""
        laps: dict[str, tuple[float, float]] = {}
        for lap in parts.laps:
            for label, (gpu, cpu) in lap.items():
                before = laps.get(label, (0.0, 0.0))
                laps[label] = before[0] + gpu, before[1] + cpu
        self.frame_ms.append(sum(parts.frame_ms))
        self.laps.append(laps)
        self.counters += parts.counters
        self.skipped += parts.skipped

    def passes(self) -> list[dict[str, float | str]]:
        """Return name, GPU and CPU median of each pass in the order in which they ran; 0 in frames that skipped it."""
        names = list(dict.fromkeys(label for frame in self.laps for label in frame))
        rest = dict.fromkeys(names, (0.0, 0.0))
        laps = [{**rest, **frame} for frame in self.laps]
        return [{"name": name, "gpu_ms": _median(laps, name, 0), "cpu_ms": _median(laps, name, 1)} for name in names]

    def skipped_passes(self) -> list[tuple[str, int, float | None]]:
        """Return the passes that some frames skipped: name, number of these frames, GPU median of the others."""
        frames = Counter(name for skipped in self.skipped for name in skipped)
        ran = {name: [frame for frame in self.laps if name in frame] for name in frames}
        return [(name, n, _median(ran[name], name, 0) if ran[name] else None) for name, n in frames.items()]

    def median_frame_ms(self) -> float:
        """Return the median wall time of a whole frame."""
        return round(median(self.frame_ms), 4)


def _median(laps: Sequence[dict[str, tuple[float, float]]], name: str, which: int) -> float:
    return round(median(frame[name][which] for frame in laps), 4)
