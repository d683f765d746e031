"""Draws textures of the renderer into the window: the picture, the output of a pass, a shadow map in the corner."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from deferred_ir.frame.frame import NEAR
from deferred_ir.gl.context import Gpu
from deferred_ir.gl.shaders import ShaderLibrary
from deferred_ir.gl.textures import GpuTexture
from deferred_ir.gl.window import Window

FOLDER = Path(__file__).parent
COLORS, LINEAR, DEPTH, NUMBERS = range(4)


@dataclass(frozen=True)
class Area:
    """A rectangle of the window, pixels from its lower left corner."""

    x: int
    y: int
    width: int
    height: int

    def fit(self, size: tuple[int, int]) -> Area:
        """Return the largest rectangle with the aspect of `size` in the middle of this one, at least one pixel."""
        scale = min(self.width / size[0], self.height / size[1])
        width, height = max(round(size[0] * scale), 1), max(round(size[1] * scale), 1)
        return Area(self.x + (self.width - width) // 2, self.y + (self.height - height) // 2, width, height)


class Canvas:
    """Draws into `window` with programs of `library`, on the context that both share."""

    def __init__(self, window: Window, gpu: Gpu, library: ShaderLibrary) -> None:
        self._window, self._gpu, self._library = window, gpu, library

    def show(
        self,
        texture: GpuTexture,
        area: Area,
        *,
        layer: int = 0,
        part: Area | None = None,
        gain: float = 1.0,
        linear: bool = False,
        split: int = 0,
    ) -> None:
        """Fill `area` with `part` of a texture, all of it by default, unfiltered.

        gain: brightness, except of finished pictures. linear: show depth as distance. split: columns at the left that
        stay as they are.
        """
        kind = _choose_kind(texture)
        part = part or Area(0, 0, *texture.size)
        self._gpu.reset()
        self._window.viewport(area.x, area.y, area.width, area.height)
        texture.bind(0, self._gpu.sampler(linear=False))
        defines = {"KIND": kind, "LAYERS": int(texture.layers > 0), "NEAR_FRACTION": NEAR}
        program = self._library.program("show.frag", defines=defines, folder=FOLDER)
        program.set(corner=(area.x, area.y), target=(area.width, area.height), split=split)
        program.set(source=(part.x, part.y), extent=(part.width, part.height), layer=layer)
        program.set(gain=gain, depth_linear=int(linear))
        program.draw_fullscreen()


def _choose_kind(texture: GpuTexture) -> int:
    """Return how show.frag turns texels into colours."""
    if texture.format.depth:
        return DEPTH
    if texture.format.dtype == "u4":
        return NUMBERS
    return COLORS if texture.format.dtype == "u1" else LINEAR
