"""`deferred-ir render`: settings from command line and scene file, frames, files."""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from deferred_ir.base.errors import OutputError
from deferred_ir.base.files import check_folder, write_json
from deferred_ir.engine.accumulation import Accumulation
from deferred_ir.engine.record import Record
from deferred_ir.engine.renderer import IMAGES, Renderer
from deferred_ir.engine.settings import chosen_settings, chosen_size, notes
from deferred_ir.graph.graph import Plan
from deferred_ir.loading.load import load
from deferred_ir.output.image import Image, check_path
from deferred_ir.report.run_json import run_record
from deferred_ir.scene.motion import FRAMES_PER_SECOND
from deferred_ir.scene.scene import Scene

_NUMBER = re.compile(r"%0\d{1,2}d")


def render(arguments: argparse.Namespace, settings: Mapping[str, Any]) -> int:
    """Render what the command line asks for; an exit status."""
    json = Path(arguments.json) if arguments.json is not None else None
    _check_files(arguments.output, json)
    scene = load(arguments.scene)
    defaults = scene.render
    outputs = arguments.output
    if not outputs and not json:
        outputs = [f"{scene.name}.png"]
        _check_files(outputs, json)
    graph_name = arguments.graph if arguments.graph is not None else defaults.graph or "deferred"
    seed = arguments.seed if arguments.seed is not None else defaults.seed or 0
    for note in _notes(scene, outputs, arguments.frames):
        print(f"note: {note}", file=sys.stderr)
    with Renderer(
        chosen_size(arguments.size, defaults),
        graph_name,
        arguments.device,
        set=chosen_settings(defaults, settings, arguments.vpls),
        reuse=arguments.reuse,
        keep_all=arguments.keep_all,
    ) as renderer:
        print(f"OpenGL on {renderer.gpu.device}", file=sys.stderr)
        graph = renderer.graph()
        wanted = _wanted(outputs, graph.outputs, averaged=arguments.accumulate > 1)
        plan = renderer.plan(scene, outputs=None if arguments.keep_all else wanted)
        record = Record() if json else None
        if record:
            renderer.draw(scene, plan, seed=seed)  # compiles, allocates: not what a frame costs
            renderer.reset()
        black, saved = bool(outputs), 0
        try:
            for picture in _pictures(renderer, scene, plan, arguments, seed=seed, record=record):
                last = picture.interrupted or picture.number == arguments.frames - 1
                due = [name for name in outputs if last or _NUMBER.search(name)]
                if due:
                    black = _save(renderer, plan, picture, due) and black
                    saved = picture.number + 1
        except KeyboardInterrupt:
            if not saved:
                raise
            print(f"deferred-ir: interrupted: wrote {saved} of {arguments.frames} frames", file=sys.stderr)
            return 130
        if json and record:
            renderer.finish(record)
            made = run_record(
                renderer, scene, str(graph_name), graph, plan, seed=seed, record=record, accumulated=picture.averaged
            )
            write_json(json, made)
        for note in _unfilled(renderer, plan, arguments):
            print(f"note: {note}", file=sys.stderr)
    if black:
        print("note: the picture is black: the camera sees nothing that is lit", file=sys.stderr)
    if outputs:
        print(f"wrote {', '.join(_told(name, picture.number + 1) for name in outputs)}", file=sys.stderr)
    if picture.interrupted:
        print(
            f"deferred-ir: interrupted: averaged {picture.averaged} of {arguments.accumulate} frames", file=sys.stderr
        )
        return 130
    return 0


@dataclass(frozen=True)
class _Picture:
    """What is drawn: its number, how many frames are averaged in it, their mean, and whether Ctrl-C ended it.

    One frame is still on the device, and there is no `image`.
    """

    number: int
    averaged: int = 1
    image: Image | None = None
    interrupted: bool = False


def _save(renderer: Renderer, plan: Plan, picture: _Picture, names: Sequence[str]) -> bool:
    """Write a picture under all `names`; whether it is black."""
    image = picture.image or renderer.read(plan)
    for name in names:
        image.save(_numbered(name, picture.number))
    return not any(part.any() for part in (image.radiance, image.display) if part is not None)


def _pictures(
    renderer: Renderer, scene: Scene, plan: Plan, arguments: argparse.Namespace, *, seed: int, record: Record | None
) -> Iterator[_Picture]:
    """All pictures, up to one that is interrupted after some frames."""
    with _progress(arguments.frames * arguments.accumulate) as tell:
        for number in range(arguments.frames):
            time = number / FRAMES_PER_SECOND
            if arguments.accumulate == 1:
                renderer.draw(scene, plan, seed=seed, time=time, record=record)
                tell()
                yield _Picture(number)
                continue
            mean = Accumulation(renderer, scene, plan, seed=seed, time=time, record=record)
            interrupted = _add_up(mean, arguments.accumulate, tell)
            yield _Picture(number, mean.frames, mean.image(), interrupted)
            if interrupted:
                return


def _add_up(mean: Accumulation, frames: int, tell: Callable[[], object]) -> bool:
    """Draw `frames` frames. Ctrl-C ends it, and the frames that are done stay; whether that was so."""
    try:
        for _ in range(frames):
            mean.draw()
            tell()
    except KeyboardInterrupt:
        if mean.frames == 0:
            raise
        return True
    return False


def _check_files(outputs: list[str], json: Path | None) -> None:
    """Before the work: everything that is written can be, and nothing twice."""
    files = [_numbered(output, 0) for output in outputs]
    for file in files:
        check_path(file)
    if json:
        check_folder(json)
        files.append(json)
    places = [file.resolve() for file in files]
    for file, place in zip(files, places, strict=True):
        if places.count(place) > 1:
            raise OutputError(f"{file}: is named twice; give each output a file of its own")


def _wanted(files: list[str], known: Mapping[str, str], *, averaged: bool) -> list[str]:
    """The outputs of the graph that the files need; all images where no file is asked for.

    Frames are averaged in radiance, whatever the files show.
    """
    names = {"display" if Path(file).suffix.lower() == ".png" else "radiance" for file in files}
    missing = names - known.keys()
    if missing:
        raise OutputError(
            f"graph: has no output '{min(missing)}', which these files need: {', '.join(files)}; add it to [outputs]"
        )
    if averaged and names:
        names.add("radiance")
    return [name for name in known if name in (names or IMAGES)]


def _numbered(name: str, frame: int) -> Path:
    return Path(_NUMBER.sub(lambda match: match[0] % frame, name))


def _told(name: str, frames: int) -> str:
    """The file or files that an output became."""
    first, last = (str(_numbered(name, i)) for i in (0, frames - 1))
    return first if first == last else f"{first} to {last}"


def _notes(scene: Scene, outputs: list[str], frames: int) -> Iterator[str]:
    yield from notes(scene)
    if frames > 1:
        for name in outputs:
            if not _NUMBER.search(name):
                path = Path(name)
                yield f"{name} keeps the last of {frames} frames; {path.stem}_%04d{path.suffix} keeps all"


def _unfilled(renderer: Renderer, plan: Plan, arguments: argparse.Namespace) -> Iterator[str]:
    """What to say where passes that keep VPLs had no budget for all of them."""
    count = getattr(renderer.graph().nodes["vpl"].work.params, "count", 0) if "vpl" in renderer.graph().nodes else 0
    if arguments.accumulate > 1:
        if plan.frames_to_fill > 1:
            yield (
                f"each of the {arguments.accumulate} frames that are averaged starts afresh, with few of {count} VPLs; "
                f"--set vpl.most={count} gives them all"
            )
        return
    counters = renderer.executor.counters
    if counters.get("vpls_waiting"):
        yield (
            f"{count - counters['vpls_waiting']} of {count} rays for VPLs so far: {plan.frames_to_fill} frames fill "
            f"the set where nothing moves, or --set vpl.most={count}"
        )


@contextmanager
def _progress(frames: int) -> Iterator[Callable[[], object]]:
    """What to call after each of `frames` frames: on a terminal, where there is more than one, it moves a bar."""
    if frames == 1 or not sys.stderr.isatty():
        yield lambda: None
        return
    from tqdm import tqdm

    with tqdm(total=frames, unit="frame") as bar:
        yield bar.update
