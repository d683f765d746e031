"""`deferred-ir check`: whether the renderer can be relied on, in extreme cases or where shadow maps stand for rays.

The measurements are in profiling/checks; this prints each row as it comes.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from deferred_ir.base.errors import SettingError
from deferred_ir.base.progress import progress_bar
from deferred_ir.cli.options import (
    SCENE,
    add_device,
    add_seed,
    add_set,
    add_size,
    add_vpls,
    parse_counts,
    parse_positive,
    print_notes,
)

if TYPE_CHECKING:
    from deferred_ir.profiling.checks import extremes, visibility
    from deferred_ir.scene.scene import RenderDefaults, Scene

HELP = "Stress-test the renderer with about 100 extreme variants of a scene; exit status 1 if one fails."
ORDER = 50
VPL_SIZE = "shadow_maps.vpl_size"


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of `deferred-ir check`; most are None unless given, since only --visibility takes them."""
    parser.add_argument("scene", nargs="?", metavar="SCENE", help=f"{SCENE} (default: all built-in scenes)")
    visibility = "instead: count where shadow maps and rays disagree; the options down to --set are for this alone"
    parser.add_argument("--visibility", action="store_true", help=visibility)
    parser.add_argument("--sizes", metavar="N,N", help="of VPLs' maps, texels (default: 256,512)")
    pairs = "pairs of a pixel and a light in each row (default: 200000)"
    parser.add_argument("--pairs", type=parse_positive, metavar="N", help=pairs)
    add_size(parser, "pixels of a frame", "256x256")
    add_vpls(parser)
    add_seed(parser)
    add_set(parser)
    add_device(parser)
    parser.add_argument("--json", metavar="F", help="write all figures")


def run(arguments: argparse.Namespace) -> int:
    """Run the checks, and print each result as it comes. Returns 1 if a case fails."""
    from deferred_ir.base.files import check_folder
    from deferred_ir.engine.settings import parse_settings

    settings = parse_settings(arguments.set)
    json = Path(arguments.json) if arguments.json is not None else None
    if json:
        check_folder(json)
    check = _check_visibility if arguments.visibility else _check_extremes
    return check(arguments, settings, json)


def _load_scenes(arguments: argparse.Namespace) -> list[Scene]:
    """Load the scene that is named, else all built-in ones."""
    from deferred_ir.loading.load import builtin_scenes, load

    names = [arguments.scene] if arguments.scene is not None else [name for name, _ in builtin_scenes()]
    return [load(name) for name in names]


# Extreme cases


def _check_extremes(arguments: argparse.Namespace, settings: Mapping[str, Any], json: Path | None) -> int:
    names = ("sizes", "pairs", "size", "vpls", "seed")
    extra = [f"--{name}" for name in names if getattr(arguments, name) is not None]
    extra += [f"--set {name}" for name in settings]
    if extra:
        raise SettingError(f"{extra[0]}: the extreme cases have settings of their own; give --visibility as well")
    from deferred_ir.base.files import write_json
    from deferred_ir.engine.settings import list_notes

    scenes = _load_scenes(arguments)
    for scene in scenes:
        moving = ["things move; checked as it is at 0 s"] if scene.moves else []
        print_notes(f"{scene.name}: {text}" for text in (*list_notes(scene), *moving))
    rows = _print_extremes(scenes, arguments.device)
    if json:
        write_json(json, {"stability": [row.as_dict() for row in rows]})
    return 0 if all(row.holds for row in rows) else 1


def _print_extremes(scenes: list[Scene], device: str) -> list[extremes.Row]:
    """Print and return all rows, and print how many there were, even if Ctrl-C ends them."""
    from deferred_ir.profiling.checks import extremes
    from deferred_ir.profiling.checks.cases import CASES

    width, total = max(len(scene.name) for scene in scenes), len(scenes) * len(CASES)
    rows = list[extremes.Row]()
    with extremes.Judge(device) as judge:  # opened first: that the device fails is no case's fault
        print(extremes.heading(width), flush=True)
        try:
            with progress_bar("", total) as bar:
                for row in (row for scene in scenes for row in judge.rows(scene, CASES)):
                    rows.append(row)
                    bar.print(extremes.line(row, width))
                    sys.stdout.flush()
                    bar.advance()
        finally:
            print(f"{len(rows)} of {total} cases, {sum(not row.holds for row in rows)} failed", flush=True)
    return rows


# Shadow maps against rays


def _check_visibility(arguments: argparse.Namespace, settings: Mapping[str, Any], json: Path | None) -> int:
    from deferred_ir.base.files import write_json

    rows = _print_visibility(list(_choose_options(arguments, settings)))
    if json:
        write_json(json, {"visibility": [row.as_dict() for row in rows]})
    return 0


def _choose_options(
    arguments: argparse.Namespace, settings: Mapping[str, Any]
) -> Iterator[tuple[Scene, visibility.Options]]:
    """Yield each scene with what to measure in it."""
    from deferred_ir.engine.settings import DEFAULT_GRAPH, choose_seed, choose_settings, choose_size
    from deferred_ir.profiling.checks import visibility
    from deferred_ir.scene.scene import RenderDefaults

    usual = visibility.Options()
    size = usual.size if arguments.size is None else choose_size(arguments.size, RenderDefaults())
    sizes = _choose_map_sizes(arguments.sizes, settings) or usual.vpl_sizes
    for scene in _load_scenes(arguments):
        yield (
            scene,
            visibility.Options(
                size=size,
                pairs=usual.pairs if arguments.pairs is None else arguments.pairs,
                vpl_sizes=sizes,
                seed=choose_seed(arguments.seed, scene.render),
                device=arguments.device,
                settings=choose_settings(DEFAULT_GRAPH, _drop_unknown(scene.render), settings, arguments.vpls),
            ),
        )


def _drop_unknown(defaults: RenderDefaults) -> RenderDefaults:
    """Return a [render] table without parameters of passes that the graph `deferred` lacks, such as `forward`."""
    from deferred_ir.graph.file import load_graph
    from deferred_ir.scene.scene import RenderDefaults

    known = load_graph("deferred").nodes
    settings = {name: value for name, value in defaults.set.items() if name.partition(".")[0] in known}
    return RenderDefaults(vpls=defaults.vpls, seed=defaults.seed, set=settings)


def _choose_map_sizes(text: str | None, settings: Mapping[str, Any]) -> list[Any]:
    """Return the sizes of VPLs' maps: `--sizes 256,512`, else what --set says, else none."""
    if text is None:
        return [settings[VPL_SIZE]] if VPL_SIZE in settings else []
    if VPL_SIZE in settings:
        raise SettingError(f"--sizes {text} and --set {VPL_SIZE}={settings[VPL_SIZE]}: contradict each other; give one")
    return parse_counts("--sizes", text, "256,512")


def _print_visibility(work: list[tuple[Scene, visibility.Options]]) -> list[visibility.Row]:
    """Print and return all rows, with a bar on a terminal."""
    from deferred_ir.engine.settings import list_notes
    from deferred_ir.profiling.checks import visibility, visibility_table

    width = max(len(scene.name) for scene, _ in work)
    rows = list[visibility.Row]()
    with progress_bar() as bar:
        for scene, options in work:
            bar.label(scene.name)
            for text in list_notes(scene):
                bar.print(f"note: {text}", sys.stderr)
            if not scene.emits:
                text = "nothing shines: no light that a map could be wrong about"
                bar.print(f"note: {scene.name}: {text}", sys.stderr)
            for row in visibility.rows(scene, options, bar.show):
                if not rows:
                    bar.print(visibility_table.heading(width))
                bar.print(visibility_table.line(row, width))
                sys.stdout.flush()
                if row.pairs < options.pairs:
                    text = f"hardly a pixel faces a light: {row.pairs} pairs, no more"
                    bar.print(f"note: {scene.name}, {row.lights}: {text}", sys.stderr)
                rows.append(row)
    return rows
