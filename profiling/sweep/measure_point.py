"""One point of a sweep: time, error, memory and images of a graph with a number of VPLs and a seed."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path

from deferred_ir.engine.measurement import Measurement
from deferred_ir.engine.renderer import Renderer
from deferred_ir.engine.setup import IMAGES
from deferred_ir.output.image import Image
from deferred_ir.profiling.sweep import points
from deferred_ir.profiling.sweep.edge_mask import Mask
from deferred_ir.profiling.sweep.points import Key, Point
from deferred_ir.profiling.sweep.reference import Truth
from deferred_ir.profiling.sweep.sweep import FRAMES, Sweep
from deferred_ir.report import left_out
from deferred_ir.report.origin import Origin
from deferred_ir.truth import error_picture
from deferred_ir.truth.flip import FlipParameters
from deferred_ir.truth.metrics import Comparison, compare, masked_relmse


@dataclass(frozen=True, eq=False)
class Setup:
    """What all points of a run have in common: their folder, and the reference and mask they are compared with."""

    sweep: Sweep
    folder: Path
    origin: Origin
    truth: Truth
    mask: Mask

    @cached_property
    def flip_parameters(self) -> FlipParameters:
        """Parameters of FLIP for the reference, so that all points have the same exposures."""
        return FlipParameters.from_reference(self.truth.radiance)


def measure(setup: Setup, renderer: Renderer, graph: str, key: Key) -> Point:
    """Draw and measure a point, and save it with its pictures. Returns it."""
    sweep, truth = setup.sweep, setup.truth
    plan = renderer.plan(sweep.scene, key.vpls, [name for name in renderer.graph(key.vpls).outputs if name in IMAGES])
    times, measured = sweep.frame_times(plan), Measurement()
    for i, time in enumerate(times):  # the first frame compiles and allocates: is not measured
        counts = i >= len(times) - FRAMES
        renderer.draw(sweep.scene, plan, seed=key.seed, time=time, measurement=measured if counts else None)
    image = renderer.read(plan)
    renderer.finish(measured)
    names = (f"{graph}, {key.vpls} VPLs, seed {key.seed}", "the reference")
    result = compare(image.radiance, truth.radiance, truth.hit, names=names, flip_parameters=setup.flip_parameters)
    # Memory and counters are of the measured frames; what follows draws others.
    memory, alive = renderer.memory(), measured.counters[-1].get("vpls_alive", 0)
    savings = left_out.list_for_frames(renderer, plan, measured)
    savings += left_out.measure_passes(renderer, sweep.moment, plan, vpls=key.vpls, seed=key.seed)
    point = Point(
        key=key,
        scene=sweep.scene.name,
        graph=graph,
        origin=setup.origin,
        reference=truth.hash,
        reference_about=truth.about,
        device=renderer.gpu.device.name,
        driver=renderer.gpu.driver,
        software=renderer.gpu.device.kind == "software",
        vpls_alive=alive,
        frames_to_fill=plan.frames_to_fill,
        retains_samples=plan.retains_samples,
        frames=[round(ms, 4) for ms in measured.frame_ms],
        laps=[[(name, round(gpu, 4), round(cpu, 4)) for name, (gpu, cpu) in laps.items()] for laps in measured.laps],
        memory=memory,
        left_out=savings,
        time=sweep.time if sweep.scene.moves else None,
        relmse=result.relmse,
        relmse_untrimmed=result.relmse_untrimmed,
        bias=result.bias,
        relmse_masked=masked_relmse(image.radiance, truth.radiance, setup.mask.counts),
        flip=result.flip,
        flip_note=result.flip_note,
        flip_parameters=asdict(setup.flip_parameters) if result.flip is not None else None,
        pictures=_save_pictures(setup, key, image, result),
    )
    points.save(setup.folder, point)
    return point


def _save_pictures(setup: Setup, key: Key, image: Image, result: Comparison) -> bool:
    """Save the picture and its error, for the first seed of graphs with an output `display`. Returns whether it did."""
    if key.seed != 0 or image.display is None:
        return False
    display, error = (points.path(setup.folder, key.name, suffix) for suffix in points.PICTURES)
    image.save(display)
    errors = error_picture.measure_signed_errors(image.radiance, setup.truth.radiance, result.reference_mean)
    error_picture.save(error, errors)
    return True
