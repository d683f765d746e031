"""`deferred-ir view`: a window in which camera and light move."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from deferred_ir.base.errors import OutputError, SettingError
from deferred_ir.cli.options import (
    SCENE,
    add_graph,
    add_seed,
    add_set,
    add_size,
    add_vpls,
    parse_positive,
    print_notes,
)

HELP = "Open a window in which camera and light move and the picture follows."
ORDER = 60


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of `deferred-ir view`."""
    parser.add_argument("scene", nargs="?", default="cornell", metavar="SCENE", help=f"{SCENE} (default: cornell)")
    add_graph(parser)
    add_size(parser, "pixels of the picture, without the panel")
    add_vpls(parser)
    add_seed(parser)
    add_set(parser)
    parser.add_argument("--frames", type=parse_positive, metavar="N", help="end after N frames")
    parser.add_argument("--screenshot", metavar="OUT.png", help="with --frames: write the window as it is then")


def run(arguments: argparse.Namespace) -> int:
    """Show a scene until its window is closed, or for --frames."""
    screenshot = _check_screenshot(arguments)
    from deferred_ir.engine.settings import (
        choose_graph,
        choose_seed,
        choose_settings,
        choose_size,
        list_notes,
        parse_settings,
    )
    from deferred_ir.gl.window import Window
    from deferred_ir.loading.load import load
    from deferred_ir.viewer.app import Viewer
    from deferred_ir.viewer.panels.side_panel import WIDTH
    from deferred_ir.viewer.session import Session

    settings = parse_settings(arguments.set)
    scene = load(arguments.scene)
    print_notes(list_notes(scene))
    width, height = choose_size(arguments.size, scene.render)
    window = Window("deferred-ir", (width + WIDTH, height))
    try:
        window.resize((width + round(WIDTH * window.scale), height))
        graph = choose_graph(arguments.graph, scene.render)
        session = Session(
            scene,
            (width, height),
            window,
            graph=graph,
            settings=choose_settings(graph, scene.render, settings, arguments.vpls),
            seed=choose_seed(arguments.seed, scene.render),
        )
        viewer = Viewer(window, session)
    except BaseException:
        window.close()
        raise
    print(f"OpenGL on {session.renderer.gpu.device}", file=sys.stderr)
    try:
        viewer.run(arguments.frames, screenshot)
    finally:
        viewer.close()
    return 0


def _check_screenshot(arguments: argparse.Namespace) -> Path | None:
    """Return where the screenshot goes, None if none is wanted. Raises an Error if it could not be written."""
    if arguments.screenshot is None:
        return None
    from deferred_ir.output.find_format import check_path, list_suffixes

    screenshot = Path(arguments.screenshot)
    if arguments.frames is None:
        raise SettingError("--screenshot: wants --frames N, the frame to write")
    pictures = " or ".join(list_suffixes("display"))
    if screenshot.suffix.lower() not in list_suffixes("display"):
        raise OutputError(f"{screenshot}: a screenshot is written as {pictures}; name a {pictures}")
    check_path(screenshot)
    return screenshot
