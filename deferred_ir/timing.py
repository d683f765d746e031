"""Medians over the frames of a run, as RUN.json and the profiler report them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from statistics import median


@dataclass
class Record:
    """What repeated frames took. Times in milliseconds; `laps` holds for each frame label -> (GPU, CPU)."""

    frame_ms: list[float] = field(default_factory=list)
    laps: list[dict[str, tuple[float, float]]] = field(default_factory=list)
    counters: list[dict[str, int]] = field(default_factory=list)

    def join(self, parts: Record) -> None:
        """Add one frame that was drawn in parts: times are added up, counters stay those of each part."""
        laps: dict[str, tuple[float, float]] = {}
        for lap in parts.laps:
            for label, (gpu, cpu) in lap.items():
                before = laps.get(label, (0.0, 0.0))
                laps[label] = before[0] + gpu, before[1] + cpu
        self.frame_ms.append(sum(parts.frame_ms))
        self.laps.append(laps)
        self.counters += parts.counters

    def passes(self) -> list[dict[str, float | str]]:
        """Name, GPU and CPU median of each pass, in the order in which they ran."""
        names = list(dict.fromkeys(label for frame in self.laps for label in frame))
        return [
            {"name": name, "gpu_ms": _median(self.laps, name, 0), "cpu_ms": _median(self.laps, name, 1)}
            for name in names
        ]

    def median_frame_ms(self) -> float:
        """Median wall time of a whole frame."""
        return round(median(self.frame_ms), 4)


def _median(laps: Sequence[dict[str, tuple[float, float]]], name: str, which: int) -> float:
    return round(median(frame[name][which] for frame in laps if name in frame), 4)
