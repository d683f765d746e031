"""Finds passes that read what no pass has written: their outputs change with what memory held before.

Two frames are drawn, each with all outputs filled beforehand: once with NaN, once with a number that means something
else. A texel that is still the filling was never written, which is fine while nobody reads it. One that differs between
the two frames, but is not the filling, was made of such a texel.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .gl.resources import GpuTexture
from .graph import Plan, Step
from .io import Io
from .scene import Scene

if TYPE_CHECKING:
    from .renderer import Renderer

FILLINGS = 0xFF, 0x55
"""Bytes. Floats of them are NaN and 1.5e13 (half: 85), whole numbers large ones."""

Texels = dict[tuple[str, str, int], np.ndarray]


def unwritten_reads(renderer: Renderer, scene: Scene, plan: Plan, *, seed: int = 0) -> list[str]:
    """Outputs, "pass.port", that depend on what nothing has written; those of passes that only pass it on as well.

    What passes keep from frame to frame is dropped before and after.
    """
    empty, drawn = [], []
    for byte in FILLINGS:
        watch = _Watch(byte)
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

    def __init__(self, byte: int) -> None:
        self.byte = byte
        self.before: Texels = {}
        self.after: Texels = {}

    def begin(self, step: Step, io: Io) -> None:
        """Before the pass."""
        for key, texture in _textures(step, io):
            texture.fill(self.byte)
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
