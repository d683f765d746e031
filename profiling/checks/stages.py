"""Measure passes in fragment and in compute shaders, and whether both give the same bits.

    python -m deferred_ir.profiling.checks.stages cornell atrium --size 512x512 --turns 61

Times are the GPU's, medians over turns. `deferred-ir doctor --calibrate` keeps such times, and passes whose parameter
`stage` is "auto" go by them.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from statistics import median

from deferred_ir.base.arrays import Array
from deferred_ir.base.progress import track
from deferred_ir.engine.measurement import Measurement
from deferred_ir.engine.renderer import Renderer
from deferred_ir.graph.stages import SUFFIXES
from deferred_ir.loading.load import load
from deferred_ir.profiling.figures import markdown
from deferred_ir.profiling.study import command_line, run
from deferred_ir.scene.scene import Scene
from deferred_ir.tuning.cache import name_machine
from deferred_ir.tuning.stage_costs import Trial, keep

GRAPH = "resampled"
"""A graph with all passes that can run in either stage."""
SCENES = "cornell", "atrium"
"""Scenes by which a machine is judged."""
SIZE = 512, 512
TURNS = 9


def try_stages(renderer: Renderer, scene: Scene, turns: int) -> dict[str, Trial]:
    """Return a trial for each pass of GRAPH that can run in either stage, by the pass's module.

    renderer: made with `keep_all`, so that no pass writes over the inputs of another. Each turn has its own seed.
    """
    names = _list_passes(renderer)
    setups = {}
    for stage in SUFFIXES:
        renderer.configure(graph=GRAPH, set={f"{name}.stage": stage for name in names})
        setups[stage] = renderer.setup
        renderer.draw(scene, renderer.plan(scene))  # compiles, and gives the passes their inputs
    trials = {}
    for name, kind in names.items():
        times: dict[str, list[float]] = {stage: [] for stage in SUFFIXES}
        equal = True
        for turn in range(turns):
            images: list[list[Array]] = []
            for stage, setup in setups.items():
                renderer.setup = setup
                plan, measurement = renderer.plan(scene), Measurement()
                renderer.draw(scene, plan, seed=turn, steps={name}, measurement=measurement)
                renderer.finish(measurement)
                times[stage].append(measurement.laps[0][name][0])
                step = next(step for step in plan.steps if step.name == name)
                images.append([renderer.read_texture((name, port)) for port in step.outputs])
            equal &= all(one.tobytes() == other.tobytes() for one, other in zip(*images, strict=True))
        trials[kind] = Trial(median(times["fragment"]), median(times["compute"]), equal)
    return trials


def _list_passes(renderer: Renderer) -> Mapping[str, str]:
    """Return name and module of the passes that can run in either stage."""
    renderer.configure(graph=GRAPH, set={})
    nodes = renderer.graph().nodes.values()
    return {node.name: type(node.work).__module__ for node in nodes if hasattr(node.work.params, "stage")}


def keep_trials(device: str = "auto") -> None:
    """Try the stages of passes on a device, and keep for it what each of them costs, on the SCENES together."""
    with Renderer(SIZE, GRAPH, device, keep_all=True) as renderer:
        found = [try_stages(renderer, load(name), TURNS) for name in track(SCENES, "trying compute shaders")]
        together = {kind: _add_up([trials[kind] for trials in found]) for kind in found[0]}
        keep(name_machine(renderer.gpu.device.name, renderer.gpu.driver), together)


def _add_up(trials: Sequence[Trial]) -> Trial:
    fragment, compute = (round(sum(t), 4) for t in zip(*((t.fragment_ms, t.compute_ms) for t in trials), strict=True))
    return Trial(fragment, compute, all(trial.equal for trial in trials))


def report(chosen: argparse.Namespace) -> None:
    """Print a row for each scene and pass, in Markdown."""
    rows = []
    with Renderer(chosen.size, GRAPH, chosen.device, keep_all=True) as renderer:
        for name in track(chosen.scenes, "trying compute shaders"):
            for kind, t in try_stages(renderer, load(name), chosen.turns).items():
                times = [f"{t.fragment_ms:.2f}", f"{t.compute_ms:.2f}", f"{t.fragment_ms / t.compute_ms:.2f}"]
                rows.append([name, f"`{kind.rpartition('.')[2]}`", *times, "yes" if t.equal else "no"])
    print(markdown(["scene", "pass", "fragment, ms", "compute, ms", "ratio", "same bits"], rows))


def main(words: Sequence[str] | None = None) -> None:
    """Run the measurement."""
    run(command_line(__doc__, size=SIZE, turns=TURNS, device="auto"), report, words)


if __name__ == "__main__":
    main()
