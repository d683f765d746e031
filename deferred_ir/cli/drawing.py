"""The pictures of `deferred-ir render`: one a frame of time, each of one frame or the mean of several."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from deferred_ir.base.progress import ProgressBar, progress_bar
from deferred_ir.engine.accumulation import Accumulation
from deferred_ir.engine.measurement import Measurement
from deferred_ir.engine.renderer import Renderer
from deferred_ir.graph.graph import Plan
from deferred_ir.output.image import Image
from deferred_ir.scene.motion import FRAMES_PER_SECOND
from deferred_ir.scene.scene import Scene


@dataclass(frozen=True)
class Picture:
    """One of the pictures, by its number.

    averaged: frames in it. image: their mean; None if it is one frame, which is still on the device.
    interrupted: whether Ctrl-C ended it before all its frames were drawn.
    """

    number: int
    averaged: int = 1
    image: Image | None = None
    interrupted: bool = False


@dataclass(frozen=True)
class Drawing:
    """What is drawn, and how often: `frames` pictures, each the mean of `accumulate` frames.

    measurement: gets what the frames cost, None if that is not asked for.
    """

    renderer: Renderer
    scene: Scene
    plan: Plan
    seed: int
    frames: int = 1
    accumulate: int = 1
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
                    self.renderer, self.scene, self.plan, seed=self.seed, time=time, measurement=self.measurement
                )
                complete = _draw_frames(mean, self.accumulate, bar)
                yield Picture(number, mean.frames, mean.image(), not complete)
                if not complete:
                    return

    def read(self) -> Image:
        """Read the last frame from the device."""
        return self.renderer.read(self.plan)


def _draw_frames(mean: Accumulation, frames: int, bar: ProgressBar) -> bool:
    """Add `frames` frames to a mean. Returns False if Ctrl-C ended that early; what is done by then counts."""
    try:
        for _ in range(frames):
            mean.draw()
            bar.advance()
    except KeyboardInterrupt:
        if mean.frames == 0:
            raise
        return False
    return True
