"""`deferred-ir render`: frames of a scene, images of them, and a record of the run."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from deferred_ir.cli.options import (
    SCENE,
    add_device,
    add_graph,
    add_seed,
    add_set,
    add_size,
    add_vpls,
    parse_duration,
    parse_positive,
    parse_relmse,
    print_notes,
)
from deferred_ir.output.find_format import list_suffixes

if TYPE_CHECKING:
    from deferred_ir.cli.drawing import Drawing, Picture
    from deferred_ir.cli.image_files import ImageFiles
    from deferred_ir.engine.renderer import Renderer
    from deferred_ir.engine.within import Choice
    from deferred_ir.graph.graph import Plan
    from deferred_ir.scene.scene import Scene

HELP = "Render a scene to images."
ORDER = 10


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of `deferred-ir render`."""
    parser.add_argument("scene", metavar="SCENE", help=SCENE)
    output = f"image: {', '.join(list_suffixes())} (%%04d: the frame); may be repeated"
    parser.add_argument("-o", "--output", action="append", default=[], metavar="OUT", help=output)
    add_graph(parser)
    add_size(parser)
    add_vpls(parser)
    add_seed(parser)
    add_device(parser)
    parser.add_argument("--frames", type=parse_positive, default=1, metavar="N", help="frame i shows time i/30 s")
    accumulate = "average K frames of fresh samples in each image; Ctrl-C keeps what is done"
    parser.add_argument("--accumulate", type=parse_positive, metavar="K", help=accumulate)
    error = "average frames until their estimate of the image's relMSE is at most E; at most K frames (default: 1024)"
    goal = parser.add_mutually_exclusive_group()
    goal.add_argument("--error", type=parse_relmse, metavar="E", help=error)
    within = "choose what is not given so that an image takes at most T, such as 0.2s or 200ms, once all is loaded"
    goal.add_argument("--within", type=parse_duration, metavar="T", help=within)
    parser.add_argument("--reuse", action="store_true", help="skip a pass while its inputs are unchanged")
    keep_all = "disable scene-specific optimisations; the pixels are the same, for testing"
    parser.add_argument("--keep-all", action="store_true", help=keep_all)
    add_set(parser)
    parser.add_argument("--json", metavar="RUN.json", help="write what was rendered, and how long it took")


def run(arguments: argparse.Namespace) -> int:
    """Draw all frames and write what is asked for; after Ctrl-C, what is done by then.

    Returns 1 where the last image has a larger error than was asked for.
    """
    from deferred_ir.base.files import write_json
    from deferred_ir.cli.image_files import ImageFiles
    from deferred_ir.engine.settings import list_notes, parse_settings
    from deferred_ir.loading.load import load

    settings = parse_settings(arguments.set)
    json = Path(arguments.json) if arguments.json is not None else None
    files = ImageFiles(arguments.output, arguments.frames, json)
    scene = load(arguments.scene)
    if not arguments.output and not json:
        files = ImageFiles([f"{scene.name}.png"], arguments.frames)
    print_notes([*list_notes(scene), *files.list_notes()])
    with _open_renderer(arguments, scene, settings) as renderer:
        print(f"OpenGL on {renderer.gpu.device}", file=sys.stderr)
        drawing, choice = _prepare_drawing(renderer, scene, files, arguments)
        try:
            for picture in drawing.draw():
                files.save(picture, drawing.read)
        except KeyboardInterrupt:
            if not files.saved:
                raise
            print(f"deferred-ir: interrupted: wrote {files.saved} of {arguments.frames} frames", file=sys.stderr)
            return 130
        print_notes([*_explain_unfilled(drawing), *_explain_error(drawing, picture)])
        if json:
            write_json(json, _describe_run(drawing, picture, choice, arguments.within))
    if files.black:
        print_notes(["the picture is black: the camera sees nothing that is lit"])
    if files.names:
        print(f"wrote {files.describe(picture.number + 1)}", file=sys.stderr)
    if picture.interrupted:
        most = "" if arguments.error else f" of {drawing.accumulate}"
        print(f"deferred-ir: interrupted: averaged {picture.averaged}{most} frames", file=sys.stderr)
        return 130
    return int(drawing.missed(picture))


def _open_renderer(arguments: argparse.Namespace, scene: Scene, settings: Mapping[str, Any]) -> Renderer:
    """Open a renderer with the options, over what the scene file asks for."""
    from deferred_ir.engine.renderer import Renderer
    from deferred_ir.engine.settings import DEFAULT_GRAPH, FOR_ERROR, choose_settings, choose_size, choose_start
    from deferred_ir.tuning.ladder import GRAPH

    start: tuple[str, Mapping[str, Any]] = DEFAULT_GRAPH, {}
    if arguments.error is not None:
        start = FOR_ERROR
    elif arguments.within is not None:
        start = GRAPH, {}
    graph, set = choose_start(arguments.graph, scene.render, start)
    return Renderer(
        choose_size(arguments.size, scene.render),
        graph,
        arguments.device,
        set={**set, **choose_settings(graph, scene.render, settings, arguments.vpls)},
        reuse=arguments.reuse,
        keep_all=arguments.keep_all,
    )


def _prepare_drawing(
    renderer: Renderer, scene: Scene, files: ImageFiles, arguments: argparse.Namespace
) -> tuple[Drawing, Choice | None]:
    """Plan what the files need; for a given time, choose how first.

    With --json a first frame compiles and allocates: that is not what frames cost.
    """
    from deferred_ir.cli.drawing import Drawing
    from deferred_ir.engine.accumulation import count_most
    from deferred_ir.engine.measurement import Measurement
    from deferred_ir.engine.settings import choose_seed
    from deferred_ir.engine.within import choose

    most, error = count_most(arguments.accumulate, arguments.error), arguments.error
    averaged = most > 1 or arguments.within is not None
    outputs = files.choose_outputs(renderer.graph().outputs, averaged=averaged, estimated=error is not None)

    def make_plan() -> Plan:
        return renderer.plan(scene, outputs=None if arguments.keep_all else outputs)

    choice = None
    if arguments.within is not None:
        choice = choose(renderer, scene, arguments.within, make_plan, frames=arguments.accumulate)
        print_notes(_explain_choice(choice, arguments.within))
        most = choice.frames
    plan = make_plan()
    seed = choose_seed(arguments.seed, scene.render)
    measurement = Measurement() if arguments.json is not None else None
    if measurement:
        renderer.draw(scene, plan, seed=seed)
        renderer.reset()
    return Drawing(renderer, scene, plan, seed, arguments.frames, most, error, measurement), choice


def _describe_run(drawing: Drawing, last: Picture, choice: Choice | None, within: float | None) -> dict[str, Any]:
    """Collect what RUN.json holds; `last`: the last picture, `choice`: what was chosen for images `within` seconds."""
    from deferred_ir.report.left_out import measure_passes
    from deferred_ir.report.lost_light import estimate_for
    from deferred_ir.report.run_json import add_measurements, describe_error, describe_run

    renderer, scene, measurement = drawing.renderer, drawing.scene, drawing.measurement
    assert measurement is not None
    renderer.finish(measurement)
    plan, seed = drawing.plan, drawing.seed
    graph, name = renderer.graph(), str(renderer.setup.name)
    run = describe_run(
        renderer, scene, name, graph, plan, seed=seed, measurement=measurement, accumulated=last.averaged
    )
    if last.estimate:
        run["error"] = describe_error(last.estimate, plan, target=drawing.error)
    if choice and within:
        run["within"] = {"target_ms": within * 1e3, "predicted_ms": choice.ms, "arguments": choice.arguments}
    bias = estimate_for(plan, renderer.tracer)
    # Last, for it draws over what the frames have left.
    add_measurements(run, bias=bias, passes=measure_passes(renderer, scene.at(run["time"]), plan, seed=seed))
    return run


def _explain_unfilled(drawing: Drawing) -> Iterator[str]:
    """Yield a note for each pass that has not completed what it keeps from frame to frame."""
    figures = drawing.renderer.executor.counters
    for step in drawing.plan.steps:
        if note := step.work.explain_unfilled(step.name, figures, drawing.accumulate):
            yield note


def _explain_error(drawing: Drawing, last: Picture) -> Iterator[str]:
    """Yield how large the error of the last picture is, where that was asked for, and what the estimate cannot see."""
    from deferred_ir.report.shared_errors import list_shared_errors

    if drawing.error is None:
        return
    if last.estimate is None:
        yield "error unknown: a single frame does not tell it"
        return
    missed = f", not the {drawing.error:g} asked for" if drawing.missed(last) else ""
    yield f"error about {last.estimate.error:.2g} (relMSE) after {last.averaged} frames{missed}"
    if shared := list_shared_errors(drawing.plan):
        yield f"what all frames get wrong alike comes on top: {'; '.join(shared)}"


def _explain_choice(choice: Choice, within: float) -> Iterator[str]:
    """Yield what was chosen for images within so many seconds, and whether that is fast enough."""
    import shlex

    yield f"chosen for {within:g} s, about {choice.ms:.0f} ms an image: {shlex.join(choice.arguments)}"
    if choice.ms > within * 1e3:
        yield f"nothing faster is known here; a smaller --size takes less than {choice.ms:.0f} ms"
