"""Choose the settings of an image for a given time: what they cost is measured here and now, on the scene itself.

What a frame costs on this machine (deferred_ir/tuning/machine_costs.py) says where on the ladder to begin; so few rungs
are measured. Times are those of frames of a running renderer: what is compiled and uploaded once does not count.
"""

from __future__ import annotations

import time as clock
from collections.abc import Callable
from dataclasses import dataclass, replace
from statistics import median
from typing import TYPE_CHECKING

from deferred_ir.base.progress import progress_bar
from deferred_ir.engine.accumulation import Accumulation
from deferred_ir.graph.graph import Plan
from deferred_ir.loading.load import load
from deferred_ir.sampling.streams import frame_seed
from deferred_ir.scene.scene import Scene
from deferred_ir.tuning import machine_costs
from deferred_ir.tuning.ladder import GRAPH, RUNGS, Rung, Settings, list_rungs
from deferred_ir.tuning.machine_costs import SIZES, MachineCosts
from deferred_ir.tuning.search import find_best

if TYPE_CHECKING:
    from deferred_ir.engine.renderer import Renderer

TURNS = 3
"""Frames of which the median counts."""
FILLED = 0.95
"""Part of the time that is filled; the rest is for frames slower than the measured ones."""
SCENE = "cornell"
"""Scene on which a machine is measured."""
PlanMaker = Callable[[], Plan]


@dataclass(frozen=True)
class Choice:
    """Settings that fit a time. frames: how many are averaged. ms: what an image is expected to take."""

    graph: str
    set: Settings
    frames: int
    ms: float

    @property
    def arguments(self) -> list[str]:
        """Arguments of `deferred-ir render` that give the same pixels."""
        values = {key: str(value).lower() if isinstance(value, bool) else value for key, value in self.set.items()}
        pairs = [word for key, value in values.items() for word in ("--set", f"{key}={value}")]
        averaged = ["--accumulate", str(self.frames)] if self.frames > 1 else []
        return ["--graph", self.graph, *pairs, *averaged]


def choose(
    renderer: Renderer, scene: Scene, seconds: float, make_plan: PlanMaker, *, frames: int | None = None
) -> Choice:
    """Choose how to render an image of `scene` in `seconds`, and configure `renderer` so.

    The renderer's graph and parameters are kept, and so is a number of `frames`; the rest is chosen. make_plan: plans
    what is to be drawn with the renderer as it is then. Where nothing is fast enough, the choice is the fastest.
    """
    kept, name, budget = renderer.setup.set, str(renderer.setup.name), seconds * 1e3 * FILLED
    rungs = list_rungs(name, renderer.graph(), kept)
    width, height = renderer.size
    costs = find_machine_costs(renderer) if name == GRAPH else None
    guesses = [_guess(rung, costs, width * height) for rung in rungs]

    def measure(number: int) -> float:
        renderer.configure(set=rungs[number].set)
        if frames is None or frames == 1:
            return median(_time_frames(renderer, scene, make_plan()))
        each, last = _measure_mean(renderer, scene, make_plan())
        return frames * each + last

    number, ms = find_best(budget, guesses, measure)
    renderer.configure(set=rungs[number].set)
    choice = Choice(name, rungs[number].set, frames or 1, ms)
    if frames is None and number == len(rungs) - 1 and 2 * ms <= budget:
        each, last = _measure_mean(renderer, scene, make_plan())
        if (most := int((budget - last) / each)) > 1:
            choice = replace(choice, frames=most, ms=most * each + last)
    renderer.reset()
    return choice


def _guess(rung: Rung, costs: MachineCosts | None, pixels: int) -> float:
    return rung.work if costs is None or rung.number is None else costs.predict(rung.number, pixels)


def _time_frames(renderer: Renderer, scene: Scene, plan: Plan) -> list[float]:
    """Return milliseconds of some frames, after one that compiles and allocates."""
    renderer.draw(scene, plan)
    times = []
    for turn in range(TURNS):
        start = clock.perf_counter()
        renderer.draw(scene, plan, seed=frame_seed(0, 1 + turn))
        times.append((clock.perf_counter() - start) * 1e3)
    return times


def _measure_mean(renderer: Renderer, scene: Scene, plan: Plan) -> tuple[float, float]:
    """Return milliseconds of each frame that is averaged, and of what makes an image of their mean."""
    mean, times = Accumulation(renderer, scene, plan), []
    mean.draw()
    mean.image()
    for _ in range(TURNS):
        start = clock.perf_counter()
        mean.draw()
        times.append((clock.perf_counter() - start) * 1e3)
    start = clock.perf_counter()
    mean.image()
    return median(times), (clock.perf_counter() - start) * 1e3


def find_machine_costs(renderer: Renderer) -> MachineCosts:
    """Read what frames cost on this machine, or measure it."""
    return machine_costs.read(describe_device(renderer)) or measure_machine(renderer)


def describe_device(renderer: Renderer) -> str:
    """Name the machine and driver of a renderer."""
    return machine_costs.describe_machine(renderer.gpu.device.name, renderer.gpu.driver)


def measure_machine(renderer: Renderer) -> MachineCosts:
    """Measure each rung of the ladder on a small scene in two sizes, and keep that; about ten seconds on two cores."""
    before, scene = renderer.setup, load(SCENE)
    ms: list[list[float]] = [[] for _ in RUNGS]
    try:
        with progress_bar("measuring this machine", len(SIZES) * len(RUNGS)) as bar:
            for side in SIZES:
                for number, set in enumerate(RUNGS):
                    renderer.configure(size=(side, side), graph=GRAPH, set=set)
                    plan = renderer.plan(scene, outputs=["radiance", "display"])
                    ms[number].append(round(min(_time_frames(renderer, scene, plan)), 3))
                    bar.advance()
    finally:
        renderer.setup = before
    renderer.reset()
    return machine_costs.keep(describe_device(renderer), ms)
