"""Timing in turns: variants alternate frame by frame, so that a noisy machine disturbs all of them alike."""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Mapping, Sequence
from typing import TypeVar

from deferred_ir.base.progress import track
from deferred_ir.engine.measurement import Measurement
from deferred_ir.engine.renderer import Renderer
from deferred_ir.gl.context import Gpu
from deferred_ir.graph.graph import Plan
from deferred_ir.scene.scene import Scene

Item = TypeVar("Item")
Name = TypeVar("Name", bound=Hashable)


def take_turns(items: Sequence[Item], turns: int, label: str = "") -> Iterator[tuple[int, Item]]:
    """Yield (turn, item) for each item in each turn, with a progress bar.

    Every other turn goes backwards, which evens out a steady drift.
    """
    for turn in track(range(turns), label):
        for item in items if turn % 2 == 0 else reversed(items):
            yield turn, item


def time_frames(
    scene: Scene,
    renderers: Mapping[Name, Renderer],
    plans: Mapping[Name, Plan],
    turns: int,
    *,
    label: str = "",
    new_seeds: bool = False,
) -> dict[Name, Measurement]:
    """Draw `turns` frames with each renderer, in turns. Returns their measurements.

    A first frame of each is not measured: it compiles and allocates. new_seeds: each turn has a seed of its own.
    """
    measurements = {name: Measurement() for name in renderers}
    for name, renderer in renderers.items():
        renderer.draw(scene, plans[name])
    for turn, name in take_turns(list(renderers), turns, label):
        renderers[name].draw(scene, plans[name], seed=turn if new_seeds else 0, measurement=measurements[name])
    for name, renderer in renderers.items():
        renderer.finish(measurements[name])
    return measurements


def name_device(device: str) -> str:
    """Return the name (GL_RENDERER) of a device, which has to be opened for that."""
    gpu = Gpu(device)
    name = gpu.device.name
    gpu.close()
    return name
