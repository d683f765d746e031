"""The base of all passes: ports and parameters as data, and the answers that compiling a graph asks for. No OpenGL.

Ideas: pure reflection (Falcor), descriptions derived from inputs (kajiya).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

from deferred_ir.graph.params import NoParams
from deferred_ir.graph.ports import Description, Input, Output

FRAME_PARTS = frozenset({"camera", "light", "models", "seed", "time"})
"""What a pass can read of a frame; `camera` includes the frame's size."""


@dataclass(frozen=True)
class Facts:
    """What compile() may know of scene and settings, to leave passes out."""

    emits: bool = True
    """The spotlight has power."""

    vpls: bool = True
    """VPLs may shine."""

    clamped: bool = True
    """VPLs light what is near them with less than they should."""

    triangles: int = 0
    pixels: int = 512 * 512

    shares: int = 1
    """A pixel is lit by one in so many VPLs."""

    software: bool = True
    """OpenGL draws on the CPU."""

    keep_all: bool = False
    """Nothing is left out that another scene would need."""

    @property
    def kept(self) -> Facts:
        """With `keep_all` those of a scene that needs every pass."""
        return replace(self, emits=True, vpls=True, clamped=True) if self.keep_all else self


class Pass:
    """Base of all passes: ports and parameters as data, `execute` does the work each frame."""

    Params: ClassVar[type] = NoParams
    inputs: ClassVar[Mapping[str, Input]] = {}
    State: ClassVar[type | None] = None
    """What the pass carries from one frame to the next: made without arguments, and `io.state` in `execute`.

    A new one is made when the pass is new, one of its outputs is allocated anew, or all frames so far are forgotten.
    """
    gives_back: ClassVar[bool] = False
    """It adds the light that VPLs' clamp takes (`bias` in RUN.json)."""
    shader_folder: ClassVar[Path | None] = None
    """Where a user's pass keeps its shaders; searched before the package's own."""

    def __init__(self, params: Any = None) -> None:
        self.params = self.Params() if params is None else params

    def outputs(self, inputs: Mapping[str, Description | None]) -> Mapping[str, Output]:
        """What it writes, a pure function of its parameters and its inputs' descriptions (None: not connected).

        Raises GraphError for what does not fit together; `compile` adds the pass's name.
        """
        raise NotImplementedError

    def informed(self, facts: Facts) -> Facts:
        """`facts` and what this pass's parameters add to them for the other passes."""
        return facts

    def unneeded(self, facts: Facts) -> str | None:
        """Why this scene does not need the pass, or None."""
        del facts
        return None

    def depends(self) -> frozenset[str]:
        """Of which FRAME_PARTS its outputs are made, besides its parameters and inputs: all, unless it names fewer.

        Where frames are reused, it runs only if one of them has changed.
        """
        return FRAME_PARTS

    def frames_to_fill(self) -> int:
        """Frames of a still scene until what it keeps from frame to frame is complete: one, unless it says more."""
        return 1

    def subpasses(self, inputs: Mapping[str, Description | None], state: Any = None) -> Sequence[Mapping[str, Any]]:
        """The parts that the pass plans for itself, one dictionary each, for whoever looks at the plan.

        state: the pass's `State` after a frame; then the parts are those of that frame.
        """
        del inputs, state
        return ()

    def execute(self, frame: Any, io: Any) -> None:
        """Do the work of one frame: `frame` is a frame.Frame, `io` an io.Io with the pass's ports."""
        raise NotImplementedError
