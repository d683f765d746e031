"""Measure the viewer's frames a second while the light moves, and where their time goes. Opens a window.

    python -m deferred_ir.profiling.limits.viewer cornell --graph incremental --vpls 64 --size 512x512 --frames 100

Without a screen, put xvfb-run -s "-screen 0 1280x720x24" before it. A frame takes input, draws panel and picture and
puts them on screen. Figures are the median frame and the quickest tenth of the frames, which other work on the machine
disturbs least.
"""

from __future__ import annotations

import argparse
import time
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from deferred_ir.gl.window import Window
from deferred_ir.loading.load import load
from deferred_ir.profiling.figures import markdown
from deferred_ir.profiling.study import command_line, run
from deferred_ir.scene.lights.spotlight import Spotlight
from deferred_ir.scene.scene import Scene
from deferred_ir.viewer.app import Viewer
from deferred_ir.viewer.panels.side_panel import WIDTH
from deferred_ir.viewer.session import Session

WARM = 5
"""Frames before the measured ones; shader programs are built in them."""
PERIOD = 40
"""Frames in which the light moves once to and fro."""
REACH = 0.1
"""How far the light moves, in diagonals of the scene."""
FRAME, REST, PRESENT = "frame", "input, panel and the rest", "present"
HEAD = "part", "median, ms", "quickest tenth, ms"


def move_light(scene: Scene, frames: int) -> Iterator[Spotlight]:
    """Yield the spotlight of each frame: it moves along the camera's horizontal axis, to a new place each time."""
    light = scene.at(0.0).spotlight
    for i in range(frames):
        by = scene.camera.axes[0] * (REACH * scene.geometry.diagonal * (abs(2 * (i % PERIOD) / PERIOD - 1) - 0.5))
        (x, y, z), (u, v, w), (a, b, c) = light.position, light.look_at, by.tolist()
        yield replace(light, motion=None, position=(x + a, y + b, z + c), look_at=(u + a, v + b, w + c))


def measure(viewer: Viewer, frames: int) -> dict[str, list[float]]:
    """Return the milliseconds of each part of each frame: every pass on the GPU, 0 if it was skipped, and the rest."""
    session, parts = viewer.session, defaultdict[str, list[float]](list)
    for number, light in enumerate(move_light(session.scene, WARM + frames)):
        start = time.perf_counter()
        session.shine(light)
        viewer.frame()
        drawn = time.perf_counter()
        with viewer.window:
            viewer.window.show()
            session.renderer.gpu.ctx.finish()
        shown = time.perf_counter()
        if number < WARM:
            continue
        laps = {
            step.name: 0.0 if step.name in session.skipped else session.laps[step.name][0]
            for step in session.plan.steps
        }
        for name, milliseconds in laps.items():
            parts[name].append(milliseconds)
        parts[REST].append((drawn - start) * 1e3 - sum(laps.values()))
        parts[PRESENT].append((shown - drawn) * 1e3)
        parts[FRAME].append((shown - start) * 1e3)
    return parts


def table(name: str, parts: dict[str, list[float]]) -> str:
    """Return frames a second and a Markdown table of the parts of a frame."""
    typical, quick = ({part: float(np.quantile(ms, q)) for part, ms in parts.items()} for q in (0.5, 0.1))
    rows = [(part, f"{typical[part]:.1f}", f"{quick[part]:.1f}") for part in parts]
    rates = f"{1e3 / typical[FRAME]:.1f} frames a second, {1e3 / quick[FRAME]:.1f} in the quickest tenth"
    return f"{name}: {rates}\n\n{markdown(HEAD, rows)}\n"


def report(chosen: argparse.Namespace) -> None:
    """Measure each scene in a window of its own and print its table."""
    width, height = chosen.size
    for name in chosen.scenes:
        window = Window("deferred-ir", (width + WIDTH, height))
        window.resize((width + round(WIDTH * window.scale), height))
        settings = {"vpl.count": chosen.vpls}
        viewer = Viewer(window, Session(load(name), chosen.size, window, graph=chosen.graph, settings=settings))
        try:
            print(table(f"{name}, {viewer.session.renderer.gpu.device}", measure(viewer, chosen.frames)))
        finally:
            viewer.close()


def main(words: Sequence[str] | None = None) -> None:
    """Run the measurement."""
    parser = command_line(__doc__, vpls=64, size=(512, 512), frames=100)
    parser.add_argument("--graph", default="incremental", metavar="NAME", help="render graph")
    run(parser, report, words)


if __name__ == "__main__":
    main()
