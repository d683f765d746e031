"""`deferred-ir check`: measurements that say whether the renderer can be relied on: extreme cases, or visibility.

A check is a module of the folder profiling that yields rows, and makes a line of a table of each.
"""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from deferred_ir.base.errors import SettingError
from deferred_ir.base.files import check_folder, write_json
from deferred_ir.engine.settings import chosen_settings, chosen_size, notes
from deferred_ir.graph.file import load_graph
from deferred_ir.loading.load import builtin_scenes, load
from deferred_ir.scene.scene import RenderDefaults, Scene

VPL_SIZE = "shadow_maps.vpl_size"


def run(arguments: argparse.Namespace, settings: Mapping[str, Any]) -> int:
    """Check what the command line asks for, and print each result as it comes; an exit status."""
    json = Path(arguments.json) if arguments.json is not None else None
    if json:
        check_folder(json)
    if not arguments.visibility:
        return _run_stability(arguments, settings, json)
    from deferred_ir.profiling.checks import visibility

    usual = visibility.Options()
    size = usual.size if arguments.size is None else chosen_size(arguments.size, RenderDefaults())
    sizes = _sizes(arguments.sizes, settings) or usual.vpl_sizes
    scenes = _scenes(arguments)
    work = []
    for scene in scenes:
        options = visibility.Options(
            size=size,
            pairs=usual.pairs if arguments.pairs is None else arguments.pairs,
            vpl_sizes=sizes,
            seed=(scene.render.seed or 0) if arguments.seed is None else arguments.seed,
            device=arguments.device,
            settings=chosen_settings(_usable(scene.render), settings, arguments.vpls),
        )
        work.append((scene, options))
    rows = _visibility(visibility, work)
    if json:
        write_json(json, {"visibility": [row.as_dict() for row in rows]})
    return 0


def _scenes(arguments: argparse.Namespace) -> list[Scene]:
    """The scene that is named, else the built-in ones."""
    names = [arguments.scene] if arguments.scene is not None else [name for name, _ in builtin_scenes()]
    return [load(name) for name in names]


def _run_stability(arguments: argparse.Namespace, settings: Mapping[str, Any], json: Path | None) -> int:
    """Stiff and extreme cases, a line for each as soon as it is known; 1 where one fails, else 0."""
    given = [f"--{name}" for name in ("sizes", "pairs", "size", "vpls", "seed") if getattr(arguments, name) is not None]
    given += [f"--set {name}" for name in settings]
    if given:
        raise SettingError(f"{given[0]}: the extreme cases have settings of their own; give --visibility as well")
    from deferred_ir.profiling.checks import extremes
    from deferred_ir.profiling.checks.cases import CASES

    scenes = _scenes(arguments)
    for scene in scenes:
        moving = ["things move; checked as it is at 0 s"] if scene.moves else []
        for text in (*notes(scene), *moving):
            print(f"note: {scene.name}: {text}", file=sys.stderr)
    rows = _stability(extremes, CASES, scenes, arguments.device)
    if json:
        write_json(json, {"stability": [row.as_dict() for row in rows]})
    return 0 if all(row.holds for row in rows) else 1


def _stability(stability: Any, cases: Sequence[Any], scenes: Sequence[Scene], device: str) -> list[Any]:
    """All rows, printed as they come, and how many there were, also where Ctrl-C ends them."""
    from tqdm import tqdm

    width, total = max(len(scene.name) for scene in scenes), len(scenes) * len(cases)
    found = list[Any]()
    with stability.Judge(device) as judge:  # a fault of the device is none of a case
        print(stability.heading(width), flush=True)
        try:
            with tqdm(total=total, leave=False, disable=not sys.stderr.isatty(), file=sys.stderr) as bar:
                for row in (row for scene in scenes for row in judge.rows(scene, cases)):
                    found.append(row)
                    tqdm.write(stability.line(row, width), file=sys.stdout)
                    sys.stdout.flush()
                    bar.update()
        finally:
            print(f"{len(found)} of {total} cases, {sum(not row.holds for row in found)} failed", flush=True)
    return found


def _visibility(visibility: Any, work: Sequence[tuple[Scene, Any]]) -> list[Any]:
    """Shadow maps against rays: all rows, printed as soon as they are known, with a bar on a terminal."""
    from tqdm import tqdm

    width = max(len(scene.name) for scene, _ in work)
    found = list[Any]()
    style = "{desc} {percentage:3.0f} % |{bar}| {elapsed}, {remaining} left"
    with tqdm(bar_format=style, leave=False, disable=not sys.stderr.isatty(), file=sys.stderr) as bar:

        def progress(done: int, total: int) -> None:
            bar.total = total
            bar.update(done - bar.n)

        def note(text: str) -> None:
            tqdm.write(f"note: {text}", file=sys.stderr)

        for scene, options in work:
            bar.set_description(scene.name)
            for text in notes(scene):
                note(text)
            if not scene.facts.emits:
                note(f"{scene.name}: the spotlight emits nothing: no light that a map could be wrong about")
            for row in visibility.rows(scene, options, progress):
                if not found:
                    tqdm.write(visibility.heading(width), file=sys.stdout)
                tqdm.write(visibility.line(row, width), file=sys.stdout)
                sys.stdout.flush()
                if row.pairs < options.pairs:
                    note(f"{scene.name}, {row.lights}: hardly a pixel faces a light: {row.pairs} pairs, no more")
                found.append(row)
                bar.reset()
    return found


def _usable(defaults: RenderDefaults) -> RenderDefaults:
    """A scene file's [render] without parameters of passes that the graph `deferred` has not, such as `forward`."""
    known = load_graph("deferred").nodes
    kept = {name: value for name, value in defaults.set.items() if name.partition(".")[0] in known}
    return RenderDefaults(vpls=defaults.vpls, set=kept)


def _sizes(text: str | None, settings: Mapping[str, Any]) -> list[Any]:
    """The sizes of VPLs' maps: those of `--sizes 256,512`, each once, else that of --set, else none."""
    if text is None:
        return [settings[VPL_SIZE]] if VPL_SIZE in settings else []
    if VPL_SIZE in settings:
        raise SettingError(f"--sizes {text} and --set {VPL_SIZE}={settings[VPL_SIZE]}: contradict each other; give one")
    names = [name.strip() for name in text.split(",")]
    for name in names:
        if not re.fullmatch(r"[0-9]{1,9}", name):
            raise SettingError(f"--sizes {text}: '{name}' is no whole number; write 256,512")
    return list(dict.fromkeys(int(name) for name in names))
