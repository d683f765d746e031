"""Finds passes that read what no pass has written: their outputs change with what memory held before.

Two frames are drawn, each with all outputs filled beforehand: once with NaN, once with numbers. A texel that is still
the filling was never written, which is fine while nobody reads it. One that differs between the two frames, but is not
the filling, was computed from such a texel.
"""

from __future__ import annotations

import copy
import itertools
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from deferred_ir.frame.pass_io import Io, single_resources
from deferred_ir.gl.textures import GpuTexture
from deferred_ir.graph.graph import Plan, Step
from deferred_ir.scene.scene import Scene

if TYPE_CHECKING:
    from deferred_ir.engine.renderer import Renderer

NAN = (0xFF,)
NUMBERS = tuple(range(0x3F, 0x2F, -1))
"""Bytes. Floats of 0x3F are 0.75 (half: 1.8), of those below smaller; no texture's filling is that of the next."""

Texels = dict[tuple[str, str, int], np.ndarray]


@dataclass
class _Outputs:
    """Texels of all outputs before and after their pass ran."""

    before: Texels = field(default_factory=dict)
    after: Texels = field(default_factory=dict)


def unwritten_reads(renderer: Renderer, scene: Scene, plan: Plan, *, seed: int = 0) -> list[str]:
    """Return the outputs, "pass.port", that depend on what nothing has written, and those of passes that read these.

    States of passes are dropped before and after.
    """
    renderer.draw(scene, plan, seed=seed)  # gives textures that grow with what is drawn their size
    drawn = []
    for filling in (NAN, NUMBERS):
        outputs = _Outputs()
        renderer.reset()
        try:
            renderer.draw(scene, _fill_and_read(plan, itertools.cycle(filling), outputs), seed=seed)
        finally:
            renderer.reset()
        drawn.append(outputs)
    one, other = drawn
    found = dict[str, None]()
    for key in one.after:
        unwritten = _bits(one.after[key]) == _bits(one.before[key])
        unwritten &= _bits(other.after[key]) == _bits(other.before[key])
        if ((_bits(one.after[key]) != _bits(other.after[key])) & ~unwritten).any():
            found[f"{key[0]}.{key[1]}"] = None
    return list(found)


def _bits(texels: np.ndarray) -> np.ndarray:
    """The texels as whole numbers: NaN is equal to itself."""
    return texels.view(np.dtype(f"u{texels.itemsize}"))


def _fill_and_read(plan: Plan, filling: Iterator[int], outputs: _Outputs) -> Plan:
    """Return the plan with passes that fill their outputs before they run, and read them afterwards."""
    return replace(plan, steps=tuple(_wrap(step, filling, outputs) for step in plan.steps))


def _wrap(step: Step, filling: Iterator[int], outputs: _Outputs) -> Step:
    """Return the step with a copy of its pass: its type, by which resources are found again, is the same."""
    work = copy.copy(step.work)

    def execute(frame: Any, io: Io) -> None:
        for key, texture in _textures(step, io):
            texture.fill(next(filling))
            outputs.before[key] = texture.read()
        step.work.execute(frame, io)
        io.gpu.barrier()
        for key, texture in _textures(step, io):
            outputs.after[key] = texture.read()

    vars(work)["execute"] = execute
    return replace(step, work=work)


def _textures(step: Step, io: Io) -> list[tuple[tuple[str, str, int], GpuTexture]]:
    return [
        ((step.name, port, number), single)
        for port in step.outputs
        for number, single in enumerate(single_resources(io[port]))
        if isinstance(single, GpuTexture)
    ]
