"""The pictures of `deferred-ir render`: one a frame of time, each of one frame or the mean of several."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import dataclass

from deferred_ir.base.progress import ProgressBar, progress_bar
from deferred_ir.engine.accumulation import Accumulation
from deferred_ir.engine.error_estimate import Estimate
from deferred_ir.engine.measurement import Measurement
from deferred_ir.engine.renderer import Renderer
from deferred_ir.graph.graph import Plan
from deferred_ir.output.image import Image
from deferred_ir.scene.motion import FRAMES_PER_SECOND
from deferred_ir.scene.scene import Scene

FAR = 1.5
"""Times the most frames from which on a note says that they will not do; predictions are no better than that."""


@dataclass(frozen=True)
class Picture:
    """One of the pictures, by its number.

    averaged: frames in it. image: their mean; None if it is one frame, which is still on the device. estimate: of their
    mean's error. interrupted: whether Ctrl-C ended it before all its frames were drawn.
    """

    number: int
    averaged: int = 1
    image: Image | None = None
    estimate: Estimate | None = None
    interrupted: bool = False


@dataclass(frozen=True)
class Drawing:
    """What is drawn, and how often: `frames` pictures, each the mean of `accumulate` frames.

    error: frames are added until the estimate of a picture's relMSE is at most this; `accumulate` is then the most.
    measurement: gets what the frames cost, None if that is not asked for.
    """

    renderer: Renderer
    scene: Scene
    plan: Plan
    seed: int
    frames: int = 1
    accumulate: int = 1
    error: float | None = None
    measurement: Measurement | None = None

    def draw(self) -> Iterator[Picture]:
        """Draw and yield all pictures, up to one that is interrupted after some of its frames."""
        with progress_bar(total=self.frames * self.accumulate, unit="frame") as bar:
            for number in range(self.frames):
                time = number / FRAMES_PER_SECOND
                if self.accumulate == 1:
                    self.renderer.draw(self.scene, self.plan, seed=self.seed, time=time, measurement=self.measurement)
                    bar.advance()
                    yield Picture(number)
                    continue
                mean = Accumulation(
                    self.renderer,
                    self.scene,
                    self.plan,
                    seed=self.seed,
                    time=time,
                    measurement=self.measurement,
                    blend=self.error is not None,
                )
                complete = self._draw_frames(mean, bar)
                yield Picture(number, mean.frames, mean.image(), mean.estimate(), not complete)
                if not complete:
                    return

    def missed(self, picture: Picture) -> bool:
        """Return whether the error of a picture is larger than was asked for, or unknown."""
        return self.error is not None and not (picture.estimate and picture.estimate.error <= self.error)

    def read(self) -> Image:
        """Read the last frame from the device."""
        return self.renderer.read(self.plan)

    def _draw_frames(self, mean: Accumulation, bar: ProgressBar) -> bool:
        """Draw a picture's frames. Returns False if Ctrl-C ended that early; what is done by then counts."""
        told = False
        try:
            for estimate in mean.draw_until(self.error, self.accumulate):
                if self.error is None or estimate is None:
                    bar.advance()
                    continue
                needed = estimate.count_frames(self.error)
                bar.label(f"error about {estimate.error:.2g}")
                bar.show(mean.frames, max(mean.frames, min(round(needed), self.accumulate)))
                if needed > FAR * self.accumulate and not told and mean.frames < self.accumulate:
                    told = True
                    bar.print(
                        f"note: an error of {self.error:g} would take about {needed:.1g} frames of this graph; "
                        f"it ends after {self.accumulate}, unless --accumulate allows more",
                        file=sys.stderr,
                    )
        except KeyboardInterrupt:
            if mean.frames == 0:
                raise
            return False
        return True
