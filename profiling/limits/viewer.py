"""Frames a second of the viewer while the light moves, and where their time goes; in a window on the display there is.

    python -m deferred_ir.profiling.limits.viewer cornell --graph incremental --vpls 64 --size 512x512 --frames 100

Without a screen: xvfb-run -s "-screen 0 1280x720x24" before it. A frame takes input, draws panel and picture and puts
them on screen; what came before it began is in it. Figures are medians, and the quickest tenth of the frames, which is
what a machine does that has nothing else to do.
"""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from deferred_ir.base.image_size import parse_size
from deferred_ir.gl.window import Window
from deferred_ir.loading.load import load
from deferred_ir.profiling.measure import arguments, markdown
from deferred_ir.scene.lights.spot import Spotlight
from deferred_ir.scene.scene import Scene
from deferred_ir.viewer.app import Viewer
from deferred_ir.viewer.panels.side_panel import WIDTH
from deferred_ir.viewer.session import Session

WARM = 5
"""Frames before those that are measured: programs are built in them."""
PERIOD = 40
"""Frames in which the light goes to and fro."""
REACH = 0.1
"""How far it goes, diagonals of the scene."""
FRAME, REST, PRESENT = "frame", "input, panel and the rest", "present"
HEAD = "part", "median, ms", "quickest tenth, ms"


def way(scene: Scene, frames: int) -> Iterator[Spotlight]:
    """The spotlight of each frame: along the camera's horizontal axis, another place in each."""
    light = scene.at(0.0).spotlight
    for i in range(frames):
        by = scene.camera.axes[0] * (REACH * scene.geometry.diagonal * (abs(2 * (i % PERIOD) / PERIOD - 1) - 0.5))
        (x, y, z), (u, v, w), (a, b, c) = light.position, light.look_at, by.tolist()
        yield replace(light, motion=None, position=(x + a, y + b, z + c), look_at=(u + a, v + b, w + c))


def measured(viewer: Viewer, frames: int) -> dict[str, list[float]]:
    """Milliseconds of each part of each frame: of every pass on the GPU, 0 where it was kept, and of the rest."""
    session, parts = viewer.session, defaultdict[str, list[float]](list)
    for number, light in enumerate(way(session.scene, WARM + frames)):
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
            step.name: 0.0 if step.name in session.kept else session.laps[step.name][0] for step in session.plan.steps
        }
        for name, milliseconds in laps.items():
            parts[name].append(milliseconds)
        parts[REST].append((drawn - start) * 1e3 - sum(laps.values()))
        parts[PRESENT].append((shown - drawn) * 1e3)
        parts[FRAME].append((shown - start) * 1e3)
    return parts


def table(name: str, parts: dict[str, list[float]]) -> str:
    """Frames a second, and the parts of a frame."""
    typical, quick = ({part: float(np.quantile(ms, q)) for part, ms in parts.items()} for q in (0.5, 0.1))
    rows = [(part, f"{typical[part]:.1f}", f"{quick[part]:.1f}") for part in parts]
    rates = f"{1e3 / typical[FRAME]:.1f} frames a second, {1e3 / quick[FRAME]:.1f} in the quickest tenth"
    return f"{name}: {rates}\n\n{markdown(HEAD, rows)}\n"


def main(words: Sequence[str] | None = None) -> int:
    """Measure each scene that is named, and print the tables."""
    parser = arguments(__doc__, output=False)
    parser.add_argument("--graph", default="incremental")
    parser.add_argument("--vpls", type=int, default=64)
    parser.add_argument("--size", type=parse_size, default=(512, 512), help="of the picture, WIDTHxHEIGHT")
    parser.add_argument("--frames", type=int, default=100)
    options = parser.parse_args(words)
    size: tuple[int, int] = options.size
    for name in options.scenes:
        window = Window("deferred-ir", (size[0] + WIDTH, size[1]))
        window.resize((size[0] + round(WIDTH * window.scale), size[1]))
        settings = {"vpl.count": options.vpls}
        viewer = Viewer(window, Session(load(name), size, window, graph=options.graph, settings=settings))
        try:
            print(table(f"{name}, {viewer.session.renderer.gpu.device}", measured(viewer, options.frames)))
        finally:
            viewer.close()
    return 0


if __name__ == "__main__":
    main()
