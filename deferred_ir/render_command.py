"""`deferred-ir render`: settings from command line and scene file, frames, files."""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from .errors import OutputError, SettingError
from .image import check_folder, check_path
from .loading import load
from .motion import FRAMES_PER_SECOND
from .renderer import Renderer
from .run_record import run_record, write
from .scene import Scene
from .scene_file import parse_size
from .timing import Record

DEFAULT_SIZE = (512, 512)
_NUMBER = re.compile(r"%0?\d*d")


def render(arguments: argparse.Namespace, settings: Mapping[str, Any]) -> int:
    """Render what the command line asks for; an exit status."""
    size = _size(arguments.size)
    json = Path(arguments.json) if arguments.json else None
    for output in arguments.output:
        check_path(_numbered(output, 0))
    if json:
        check_folder(json)
    scene = load(arguments.scene)
    outputs = arguments.output or ([] if json else [f"{scene.name}.png"])
    defaults = scene.render
    graph_name = arguments.graph or defaults.graph or "deferred"
    vpls = arguments.vpls if arguments.vpls is not None else defaults.vpls
    seed = arguments.seed if arguments.seed is not None else defaults.seed or 0
    for note in _notes(scene, arguments.frames):
        print(f"note: {note}", file=sys.stderr)
    with Renderer(
        size or defaults.size or DEFAULT_SIZE, graph_name, arguments.device, set={**defaults.set, **settings}
    ) as renderer:
        print(f"OpenGL on {renderer.gpu.device}", file=sys.stderr)
        plan = renderer.plan(scene, vpls, _wanted(outputs, renderer.graph(vpls).outputs))
        record = Record() if json else None
        if record:
            renderer.draw(scene, plan, seed=seed)  # compiles, allocates: not what a frame costs
        for i in _progress(arguments.frames):
            renderer.draw(scene, plan, seed=seed, time=i / FRAMES_PER_SECOND, record=record)
            last = i == arguments.frames - 1
            due = [name for name in outputs if last or _NUMBER.search(name)]
            if due:
                image = renderer.read(plan)
                for name in due:
                    image.save(_numbered(name, i))
        if json and record:
            renderer.finish(record)
            graph = renderer.graph(vpls)
            write(json, run_record(renderer, scene, str(graph_name), graph, plan, seed=seed, record=record))
    return 0


def _size(text: str | None) -> tuple[int, int] | None:
    if text is None:
        return None
    size = parse_size(text)
    if size is None:
        raise SettingError(f"--size {text}: wants WIDTHxHEIGHT in pixels, both above 0, such as 512x512")
    return size


def _wanted(files: list[str], known: Mapping[str, str]) -> list[str]:
    """The outputs of the graph that the files need; all of them where no file is asked for."""
    names = {"display" if Path(file).suffix.lower() == ".png" else "radiance" for file in files}
    missing = names - known.keys()
    if missing:
        raise OutputError(
            f"graph: has no output '{min(missing)}', which these files need: {', '.join(files)}; add it to [outputs]"
        )
    return [name for name in known if name in names or not files]


def _numbered(name: str, frame: int) -> Path:
    return Path(_NUMBER.sub(lambda match: match[0] % frame, name))


def _notes(scene: Scene, frames: int) -> Iterator[str]:
    yield from scene.notes
    yield from (f"no {what} in the file: {how.get('why', 'one was chosen')}" for what, how in scene.chosen.items())
    if scene.spotlight.radius > 0:
        yield "spotlight.radius: soft shadows are not drawn yet; the light is taken as a point"
    if frames > 1 and any(model.motion for model in scene.models):
        yield "model.motion: moving models are not drawn yet; they stand still"


def _progress(frames: int) -> Iterator[int]:
    """Frame numbers, with a progress bar on a terminal where there is more than one."""
    if frames == 1 or not sys.stderr.isatty():
        return iter(range(frames))
    from tqdm import tqdm

    return iter(tqdm(range(frames), unit="frame"))
