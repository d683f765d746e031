"""What leaving out saves: frame time, start and memory with it and without, in turns.

python -m deferred_ir.profiling.studies.left_out cornell atrium colors
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path
from statistics import median

import numpy as np

from deferred_ir.engine.record import Record
from deferred_ir.engine.renderer import Renderer
from deferred_ir.loading.load import load
from deferred_ir.profiling.limits.host_costs import seconds
from deferred_ir.profiling.measure import arguments, markdown

GRAPHS = ("deferred", "interleaved")
HEAD = ("scene", "graph", "frame [ms]", "all kept", "start [s]", "all kept", "memory [MiB]", "all kept")
WAYS = (False, True)
"""Whether all is kept."""
STARTS = 5
"""Processes of each way that are started."""


def in_turn(turns: int) -> Iterator[int]:
    """Each way once in every turn; every other turn goes backwards, which evens out a steady drift."""
    for turn in range(turns):
        yield from WAYS[:: 1 if turn % 2 == 0 else -1]


def frames(
    scene: str, graph: str, *, vpls: int, size: tuple[int, int], turns: int, device: str
) -> tuple[list[float], list[int]]:
    """Median time of a frame [ms] and the memory [bytes] of each way; RuntimeError if images differ in a single bit."""
    loaded = load(scene)
    with ExitStack() as stack:
        renderers = [stack.enter_context(Renderer(size, graph, device, keep_all=way)) for way in WAYS]
        plans = [one.plan(loaded, vpls, ["radiance", "display"]) for one in renderers]
        records = [Record() for _ in WAYS]
        for one, plan in zip(renderers, plans, strict=True):
            one.draw(loaded, plan)  # compiles, allocates: not what a frame costs
        for way in in_turn(turns):
            renderers[way].draw(loaded, plans[way], record=records[way])
        images = [one.read(plan).radiance for one, plan in zip(renderers, plans, strict=True)]
        if not np.array_equal(*images):
            raise RuntimeError(f"{scene}, {graph}: leaving out has changed the image")
        return [median(record.frame_ms) for record in records], [sum(one.memory().values()) for one in renderers]


def starts(scene: str, graph: str, *, vpls: int, size: tuple[int, int], turns: int, device: str) -> list[float]:
    """The shortest wall time [s] of a process that renders one image, of each way."""
    times: list[list[float]] = [[] for _ in WAYS]
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "deferred_ir", "render", scene, "-o", str(Path(folder, "image.png"))]
        command += ["--graph", graph, "--vpls", str(vpls), "--size", "x".join(map(str, size)), "--device", device]
        for way in in_turn(turns):
            times[way].append(seconds([*command, "--keep-all"] if way else command))
    return [min(some) for some in times]


def row(
    scene: str, graph: str, *, vpls: int = 64, size: tuple[int, int] = (512, 512), turns: int = 15, device: str = "auto"
) -> Sequence[str]:
    """A row of the table."""
    ms, memory = frames(scene, graph, vpls=vpls, size=size, turns=turns, device=device)
    start = starts(scene, graph, vpls=vpls, size=size, turns=min(turns, STARTS), device=device)
    cells = [f"{figure:.0f}" for figure in ms] + [f"{figure:.2f}" for figure in start]
    return [scene, graph, *cells, *(f"{figure / 2**20:.1f}" for figure in memory)]


def main() -> None:
    """Measure and print."""
    parser = arguments(__doc__, output=False)
    parser.add_argument("--vpls", type=int, default=64, metavar="N")
    parser.add_argument("--turns", type=int, default=15, metavar="N")
    parser.add_argument("--device", default="auto", metavar="D")
    chosen = parser.parse_args()
    options = {"vpls": chosen.vpls, "turns": chosen.turns, "device": chosen.device}
    print(markdown(HEAD, [row(scene, graph, **options) for scene in chosen.scenes for graph in GRAPHS]))


if __name__ == "__main__":
    main()
