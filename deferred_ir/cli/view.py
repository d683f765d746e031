"""`deferred-ir view`: settings from command line and scene file, a window, and what it shows."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from deferred_ir.base.errors import OutputError, SettingError
from deferred_ir.engine.settings import chosen_settings, chosen_size, notes
from deferred_ir.gl.window import Window
from deferred_ir.loading.load import load
from deferred_ir.output.image import check_path
from deferred_ir.viewer.app import Viewer
from deferred_ir.viewer.panels.side_panel import WIDTH
from deferred_ir.viewer.session import Session


def run(arguments: argparse.Namespace, settings: Mapping[str, Any]) -> int:
    """Show what the command line asks for; an exit status."""
    screenshot = Path(arguments.screenshot) if arguments.screenshot is not None else None
    if screenshot:
        if arguments.frames is None:
            raise SettingError("--screenshot: wants --frames N, the frame to write")
        if screenshot.suffix.lower() != ".png":
            raise OutputError(f"{screenshot}: a screenshot is written as .png; name a .png")
        check_path(screenshot)
    scene = load(arguments.scene)
    for note in notes(scene):
        print(f"note: {note}", file=sys.stderr)
    defaults = scene.render
    width, height = chosen_size(arguments.size, defaults)
    window = Window("deferred-ir", (width + WIDTH, height))
    try:
        window.resize((width + round(WIDTH * window.scale), height))
        session = Session(
            scene,
            (width, height),
            window,
            graph=arguments.graph if arguments.graph is not None else defaults.graph or "deferred",
            settings=chosen_settings(defaults, settings, arguments.vpls),
            seed=arguments.seed if arguments.seed is not None else defaults.seed or 0,
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
