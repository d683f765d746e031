"""Check in a long run of one process that memory, the number of OpenGL objects and the images do not change.

    python -m deferred_ir.profiling.checks.soak --frames 20000 --loads 500

One renderer draws stretches of frames with a moving light, each stretch with other settings, again and again. In
between, scenes are loaded anew, one in ten on a context of its own. The first tenth of the run is a warm-up. The exit
status is 1 if anything grows after it or an image differs.
"""

from __future__ import annotations

import ctypes
import gc
import hashlib
import resource
import sys
import time as clock
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import deferred_ir as ir
from deferred_ir.base.progress import progress_bar
from deferred_ir.engine.measurement import Measurement
from deferred_ir.graph.file import find_obstacles
from deferred_ir.profiling.figures import markdown
from deferred_ir.profiling.study import command_line
from deferred_ir.scene.motion import FRAMES_PER_SECOND, LissajousMotion
from deferred_ir.scene.scene import Scene

STRETCH = 20
"""Frames with the same settings."""
FRESH = 10
"""The first of this many loads gets a context of its own."""
SCENES = ("cornell", "colors")
SLACK = 8
"""MiB that resident memory may grow by, since allocators and drivers take it in larger pieces."""
SETTINGS: tuple[dict[str, Any], ...] = (
    {"graph": "deferred", "size": (48, 32), "set": {"vpl.count": 16}},
    {"graph": "deferred", "size": (48, 32), "set": {"vpl.count": 16, "tonemap.exposure": 1.0}},
    {"graph": "deferred", "size": (32, 48), "set": {"vpl.count": 4, "shadow_maps.vpl_size": 32}},
    {"graph": "hemisphere", "size": (32, 48), "set": {"vpl.count": 8}},
    {"graph": "interleaved", "size": (48, 32), "set": {"vpl.count": 16}},
    {"graph": "incremental", "size": (48, 32), "set": {"vpl.count": 16}},
    {"graph": "mapped", "size": (48, 32), "set": {"vpl.count": 16}},
    {"graph": "accurate", "size": (48, 32), "set": {"vpl.count": 128}},
    {"graph": "resampled", "size": (48, 32), "set": {"vpl.count": 4}},
    {"graph": "forward", "size": (48, 32), "set": {"vpl.count": 4, "shadow_maps.spot_size": 256}},
    *([] if "denoised" in find_obstacles() else [{"graph": "denoised", "size": (48, 32), "set": {"vpl.count": 4}}]),
)

ROUND = 2 * len(SETTINGS)
"""Stretches until everything was done once: all settings, with and without reuse of unchanged results."""


@dataclass(frozen=True)
class Count:
    """The number of objects by kind and the memory in MiB after a number of frames and loads."""

    frames: int
    loads: int
    objects: dict[str, int]
    memory: float


@dataclass
class Soak:
    """The progress and results of a run. images: digests of the first image of each kind."""

    frames: int = 0
    loads: int = 0
    counts: list[Count] = field(default_factory=list)
    images: dict[str, str] = field(default_factory=dict)
    different: list[str] = field(default_factory=list)

    def count(self, one: ir.Renderer) -> None:
        """Count objects and memory."""
        with one.gpu.ctx:
            self.counts.append(Count(self.frames, self.loads, one.gpu.gl.count_objects(), measure_memory()))

    def compare(self, kind: str, image: ir.Image) -> None:
        """Compare an image with the first of its kind."""
        assert image.radiance is not None
        assert image.display is not None
        digest = hashlib.sha256(image.radiance.tobytes() + image.display.tobytes()).hexdigest()
        if self.images.setdefault(kind, digest) != digest:
            self.different.append(f"another image: {kind}, after {self.frames} frames and {self.loads} loads")

    @property
    def warm(self) -> Count:
        """The count after a tenth of the run, when programs are compiled and allocators are warm."""
        return self.counts[len(self.counts) // 10]

    @property
    def faults(self) -> list[str]:
        """What has grown since a tenth of the run, and images that differ."""
        first, last = self.warm, self.counts[-1]
        grown = [
            f"{kind}: {count} became {last.objects[kind]}"
            for kind, count in first.objects.items()
            if last.objects[kind] > count
        ]
        if last.memory > first.memory + SLACK:
            grown.append(f"memory: {first.memory:.0f} MiB became {last.memory:.0f}")
        return grown + self.different


def measure_memory() -> float:
    """Return the resident memory in MiB, after returning free memory to Linux, which allocators would hold back."""
    gc.collect()
    ctypes.CDLL(None).malloc_trim(0)
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * resource.getpagesize() / 2**20


def soak(frames: int, loads: int, seconds: float) -> Iterator[Soak]:
    """Draw stretch after stretch, for at most `seconds`. Yields the state after each."""
    done, until = Soak(), clock.monotonic() + seconds
    stretches = -(-frames // STRETCH)
    scene = move_light(ir.load("cornell"))
    with ir.Renderer(**SETTINGS[0]) as one:
        for number in range(stretches):
            if clock.monotonic() > until:
                break
            which = number % len(SETTINGS)
            one.reuse = number % ROUND >= len(SETTINGS)
            one.configure(**SETTINGS[which])
            done.compare(f"setting {which}", draw_stretch(one, scene, min(STRETCH, frames - done.frames)))
            done.frames += min(STRETCH, frames - done.frames)
            for _ in range(loads * (number + 1) // stretches - done.loads):
                done.loads += 1
                load_scene(one, SCENES[done.loads % len(SCENES)], done)
            if number % ROUND == ROUND - 1 or number == stretches - 1:
                done.count(one)
            yield done


def move_light(scene: Scene) -> Scene:
    """Let the scene's light move."""
    reach = 0.05 * scene.geometry.diagonal
    motion = LissajousMotion((reach, reach / 4, reach), (3.0, 2.0))
    return replace(scene, lights=(replace(scene.spotlight, motion=motion),))


def draw_stretch(one: ir.Renderer, scene: Scene, frames: int) -> ir.Image:
    """Draw and time frames after a reset. Returns the last; a shorter stretch ends with the same frame."""
    one.reset()
    plan, measurement = one.plan(scene), Measurement()
    for frame in [*range(frames - 1), STRETCH - 1]:
        one.draw(scene, plan, time=frame / FRAMES_PER_SECOND, measurement=measurement)
    one.finish(measurement)
    return one.read(plan)


def load_scene(one: ir.Renderer, name: str, done: Soak) -> None:
    """Load a scene and render it, on `one` or, for one load in FRESH, on a context of its own."""
    scene = ir.load(name)
    if done.loads % FRESH != 1:
        one.reset()
        one.configure(**SETTINGS[0])
        done.compare(name, one.render(scene))
    else:
        with ir.Renderer(**SETTINGS[0]) as other:
            done.compare(name, other.render(scene))


def table(done: Soak) -> str:
    """Return a Markdown table of objects and memory after a tenth of the run, half-way and at the end."""
    chosen = [done.warm, done.counts[len(done.counts) // 2], done.counts[-1]]
    head = ("", "frames", "loads", *chosen[0].objects, "MiB")
    rows = [
        (when, f"{count.frames}", f"{count.loads}", *map(str, count.objects.values()), f"{count.memory:.0f}")
        for when, count in zip(("a tenth", "half-way", "end"), chosen, strict=True)
    ]
    return markdown(head, rows)


def main() -> int:
    """Run, and print the table and the faults. Returns an exit status."""
    parser = command_line(__doc__, scenes=False, frames=20000)
    parser.add_argument("--loads", type=int, default=500, metavar="N", help="scenes loaded among the frames")
    parser.add_argument("--minutes", type=float, default=30.0, metavar="N", help="longest run")
    chosen = parser.parse_args()
    done = Soak()
    try:
        with progress_bar("frames", chosen.frames, unit="frame") as bar:
            for done in soak(chosen.frames, chosen.loads, 60 * chosen.minutes):
                bar.show(done.frames, chosen.frames)
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
    if len(done.counts) < 2:
        print(f"{done.frames} frames: fewer than two rounds, too few to compare", file=sys.stderr)
        return 1
    print(table(done))
    for fault in done.faults:
        print(fault, file=sys.stderr)
    return 1 if done.faults or done.frames < chosen.frames else 0


if __name__ == "__main__":
    sys.exit(main())
