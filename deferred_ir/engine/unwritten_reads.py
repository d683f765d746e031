"""Finds passes that read what no pass has written: their outputs change with what memory held before.

Two frames are drawn, each with all outputs filled beforehand: once with NaN, once with numbers. A texel that is still
the filling was never written, which is fine while nobody reads it. One that differs between the two frames, but is not
the filling, was made of such a texel.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from deferred_ir.frame.pass_io import Io
from deferred_ir.gl.textures import GpuTexture
from deferred_ir.graph.graph import Plan, Step
from deferred_ir.scene.scene import Scene

if TYPE_CHECKING:
    from deferred_ir.engine.renderer import Renderer

NAN = (0xFF,)
NUMBERS = tuple(range(0x3F, 0x2F, -1))
"""Bytes. Floats of 0x3F are 0.75 (half: 1.8), of those below smaller; no texture's filling is that of the next."""

Texels = dict[tuple[str, str, int], np.ndarray]


def unwritten_reads(renderer: Renderer, scene: Scene, plan: Plan, *, seed: int = 0) -> list[str]:
    """Outputs, "pass.port", that depend on what nothing has written; those of passes that only pass it on as well.

    What passes keep from frame to frame is dropped before and after.
    """
    empty, drawn = [], []
    renderer.draw(scene, plan, seed=seed)  # gives textures that grow with what is drawn their size
    for fillings in (NAN, NUMBERS):
        watch = _Watch(fillings)
        renderer.reset()
        renderer.executor.watch = watch
        try:
            renderer.draw(scene, plan, seed=seed)
        finally:
            renderer.executor.watch = None
            renderer.reset()
        empty.append(watch.before)
        drawn.append(watch.after)
    found = dict[str, None]()
    for key, one in drawn[0].items():
        other = drawn[1][key]
        unwritten = _bits(one) == _bits(empty[0][key])
        unwritten &= _bits(other) == _bits(empty[1][key])
        if ((_bits(one) != _bits(other)) & ~unwritten).any():
            found[f"{key[0]}.{key[1]}"] = None
    return list(found)


def _bits(texels: np.ndarray) -> np.ndarray:
    """As whole numbers: NaN is equal to itself."""
    return texels.view(np.dtype(f"u{texels.itemsize}"))


class _Watch:
    """Fills outputs before their pass runs, and reads them after it."""

    def __init__(self, fillings: Sequence[int]) -> None:
        self._fillings = itertools.cycle(fillings)
        self.before: Texels = {}
        self.after: Texels = {}

    def begin(self, step: Step, io: Io) -> None:
        """Before the pass."""
        for key, texture in _textures(step, io):
            texture.fill(next(self._fillings))
            self.before[key] = texture.read()

    def end(self, step: Step, io: Io) -> None:
        """After it."""
        for key, texture in _textures(step, io):
            self.after[key] = texture.read()


def _textures(step: Step, io: Io) -> list[tuple[tuple[str, str, int], GpuTexture]]:
    found = []
    for port in step.outputs:
        resource = io[port]
        for i, single in enumerate(resource if isinstance(resource, list) else [resource]):
            if isinstance(single, GpuTexture):
                found.append(((step.name, port, i), single))
    return found
