"""Average many frames with fresh samples: progressive rendering, for any graph.

What the graph calls `radiance` is averaged in 64 bits, put back in its place, and the passes that read it run on that
mean: so display pixels come from the graph's own tone map, of the mean, not from a mean of display pixels. For an
image of a given error a graph's `unfiltered` radiance is averaged as well (deferred_ir/engine/error_estimate.py).
"""

from __future__ import annotations

import math
import time as clock
from collections.abc import Container, Iterator
from dataclasses import replace
from numbers import Integral, Real
from typing import Any, Protocol

from deferred_ir.base.errors import GraphError, SettingError
from deferred_ir.engine.error_estimate import Estimate, Spread
from deferred_ir.engine.measurement import Measurement
from deferred_ir.engine.setup import UNFILTERED
from deferred_ir.graph.graph import Plan
from deferred_ir.output.image import Image
from deferred_ir.sampling.streams import frame_seed
from deferred_ir.scene.scene import Scene

LAP = "accumulate"
"""Name of the time that adding up takes, among those of passes."""
FEWEST = 2
"""Frames that tell an error."""
FIRST_LOOK = 4
"""Frames before the first look at a given error: with fewer the estimate is too often off by more than half."""
MOST = 1024
"""Frames for a given error, unless another number is asked for."""


class FrameSource(Protocol):
    """Draws frames and gives access to what their passes wrote: a Renderer, in general."""

    def draw(
        self,
        scene: Scene,
        plan: Plan,
        *,
        seed: int = ...,
        time: float = ...,
        measurement: Measurement | None = ...,
        steps: Container[str] | None = ...,
    ) -> None:
        """Draw one frame, or of its passes only those named in `steps`."""

    def finish(self, measurement: Measurement) -> None:
        """Add the times that are still in flight to `measurement`."""

    def read(self, plan: Plan) -> Image:
        """Read the image that the last frame left."""

    def read_texture(self, source: tuple[str, str]) -> Any:
        """Return what the output `source` holds."""

    def write_texture(self, source: tuple[str, str], pixels: Any) -> None:
        """Write `pixels` into the output `source`."""


class Accumulation:
    """Draws frames of `scene` at `time`, one by one, and averages them; frame k of seed s has frame_seed(s, k).

    plan: has the output radiance; all other images must be made of it. measurement: gets one
    frame for each image, its time all that was drawn for it, and the counters of each frame drawn. blend: average the
    plan's output `unfiltered`, too, if it has that, and blend it in as far as that lessens the error. Raises GraphError
    where the plan does not fit.

    latest: the last estimate of the error, which may be of fewer frames than there are now.
    """

    def __init__(
        self,
        renderer: FrameSource,
        scene: Scene,
        plan: Plan,
        *,
        seed: int = 0,
        time: float = 0.0,
        measurement: Measurement | None = None,
        blend: bool = False,
    ) -> None:
        if "radiance" not in plan.outputs:
            raise GraphError(f"{plan.origin}: has no output 'radiance', which is what frames are averaged in; add it")
        self._source = plan.outputs["radiance"]
        self._unfiltered = plan.outputs.get(UNFILTERED) if blend else None
        self.follow(plan)
        if plan.outputs.get("display", self._source)[0] in self._early - {self._source[0]}:
            raise GraphError(
                f"{plan.origin}: outputs.display: is not made of outputs.radiance, so it cannot show the mean of "
                "frames; ask for files of linear radiance only, such as .npy, or for one frame"
            )
        self._renderer, self._scene, self._seed, self._time = renderer, scene, seed, time
        self._measurement, self._parts = measurement, Measurement() if measurement else None
        self._adding_ms = 0.0
        self._spread = Spread()
        self.latest: Estimate | None = None

    def follow(self, plan: Plan) -> None:
        """Go on with `plan`, which differs from the one before only in what reads the mean."""
        self._plan, self._late = plan, find_readers(plan, self._source)
        self._early = {step.name for step in plan.steps} - self._late

    @property
    def frames(self) -> int:
        """How many frames are in the mean."""
        return self._spread.frames

    @property
    def total(self) -> Any:
        """The sum of the frames so far, float64 (H, W, 4), bottom row first; a new array for each frame."""
        return self._spread.filtered.total

    def draw(self) -> None:
        """Draw the next frame and add it. A frame that is interrupted, for example by Ctrl-C, does not count."""
        self._run(frame_seed(self._seed, self.frames), self._early)
        start = clock.perf_counter()
        outputs = [self._renderer.read_texture(source) for source in (self._source, self._unfiltered) if source]
        self._spread = self._spread.add(*outputs)  # at once, whenever an interrupt comes
        self._adding_ms += (clock.perf_counter() - start) * 1e3

    def estimate(self) -> Estimate | None:
        """Estimate the error of the mean as it is now; None before its second frame."""
        if self.latest is None or self.latest.frames != self.frames:
            start = clock.perf_counter()
            self.latest = self._spread.estimate()
            self._adding_ms += (clock.perf_counter() - start) * 1e3
        return self.latest

    def draw_until(self, error: float | None, most: int) -> Iterator[Estimate | None]:
        """Draw frames until the estimate is at most `error`, but no more than `most`; as many as that without `error`.

        Yields the latest estimate after each frame, None without `error`.
        """
        look, latest = FIRST_LOOK, None
        while self.frames < most and not (error and latest and latest.error <= error):
            self.draw()
            if error and self.frames >= min(look, most):
                latest = self.estimate()
                needed = latest.count_frames(error) if latest else 0
                look = int(min(max(needed, self.frames + 1), 2 * self.frames))
            yield latest

    def image(self) -> Image:
        """Return the mean of the frames so far, at least one."""
        estimate = self.estimate()
        self.show()
        image = self._renderer.read(self._plan)
        return replace(image, frames=self.frames, error_estimate=estimate.error if estimate else None)

    def show(self) -> None:
        """Write the mean in the place of radiance, and run what reads it."""
        estimate = self.estimate() if self._unfiltered else None
        self._renderer.write_texture(self._source, self._spread.mean(estimate.share if estimate else 1.0))
        self._run(self._seed, self._late)
        if self._measurement and self._parts:
            self._renderer.finish(self._parts)
            for figures in (self._parts.counters, self._parts.skipped):
                figures.pop()  # of the passes that came after the frames
            self._parts.frame_ms.append(self._adding_ms)
            self._parts.laps.insert(-1, {LAP: (self._adding_ms, self._adding_ms)})
            self._measurement.add_frame(self._parts)
            self._parts, self._adding_ms = Measurement(), 0.0

    def _run(self, seed: int, steps: set[str]) -> None:
        self._renderer.draw(self._scene, self._plan, seed=seed, time=self._time, measurement=self._parts, steps=steps)


def count_most(frames: int | None, error: float | None) -> int:
    """Return how many frames to average at most: `frames`, or a default for an image with or without a given `error`.

    Raises SettingError for numbers that make no sense.
    """
    least = 1 if error is None else FEWEST
    if error is not None and not (isinstance(error, Real) and 0 < float(error) < math.inf):
        raise SettingError(f"error {error!r}: wants a relMSE above 0, such as 0.01")
    if frames is None:
        return 1 if error is None else MOST
    if not isinstance(frames, Integral) or frames < least:
        why = "" if error is None else "; fewer frames do not tell their error"
        raise SettingError(f"accumulate {frames!r}: wants a whole number of {least} or more{why}")
    return int(frames)


def find_readers(plan: Plan, source: tuple[str, str]) -> set[str]:
    """Return the names of the steps that read what `source` (pass, port) wrote, themselves or through others."""
    found: set[str] = set()
    for step in plan.steps:
        if any(wire and (wire == source or wire[0] in found) for wire in step.sources.values()):
            found.add(step.name)
    return found
