"""The base of all passes: ports and parameters as data, and the answers that compiling a graph asks for. No OpenGL.

Ideas: pure reflection (Falcor), descriptions derived from inputs (kajiya).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar

from deferred_ir.graph.facts import Facts, Statements
from deferred_ir.graph.figures import Figure
from deferred_ir.graph.params import NoParams
from deferred_ir.graph.ports import Description, Input, Output

NO_FACTS: Statements = {}


class Pass:
    """Base of all passes: ports and parameters as data, `execute` does the work of each frame."""

    Params: ClassVar[type] = NoParams
    inputs: ClassVar[Mapping[str, Input]] = {}
    State: ClassVar[type | None] = None
    """What the pass carries from one frame to the next: made without arguments, and `io.state` in `execute`.

    A new one is made when the pass is new, one of its outputs is allocated anew, or all frames so far are forgotten.
    """
    figures: ClassVar[Sequence[Figure]] = ()
    """Figures that the pass publishes, and where RUN.json has them."""
    retains_samples: ClassVar[bool] = False
    """Whether outputs hold samples of earlier frames: then the time of a frame is not what its image took."""
    shader_folder: ClassVar[Path | None] = None
    """Folder of a user's shaders, searched before the package's own."""

    def __init__(self, params: Any = None) -> None:
        self.params = self.Params() if params is None else params

    def outputs(self, inputs: Mapping[str, Description | None]) -> Mapping[str, Output]:
        """Return what the pass writes: a pure function of its parameters and of its inputs' descriptions.

        inputs: None for a port that is not connected. Raises GraphError for what does not fit together; `compile` adds
        the pass's name.
        """
        raise NotImplementedError

    def outputs_for(self, facts: Facts, inputs: Mapping[str, Description | None]) -> Mapping[str, Output]:
        """Return `outputs` where their sizes follow from facts of the scene."""
        del facts
        return self.outputs(inputs)

    def unneeded_outputs(self, facts: Facts) -> Mapping[str, str]:
        """Return the ports that are not needed where `facts` hold, and why; their readers go without, as of a pass."""
        del facts
        return {}

    def state_facts(self, facts: Facts) -> Statements:
        """Return the facts that the pass's parameters imply for other passes, {Fact: value}.

        facts: what is known of scene, settings and device, without what passes state. Where two passes contradict each
        other, a fact counts as unknown.
        """
        del facts
        return NO_FACTS

    def unneeded(self, facts: Facts) -> str | None:
        """Return why the pass is not needed where `facts` hold, or None if it is."""
        del facts
        return None

    def find_obstacle(self) -> str | None:
        """Return why the pass cannot run on this machine, and the mend, in a line; None if it can.

        For what comes with an optional package, say. Asked before anything is drawn.
        """
        return None

    def depends(self) -> frozenset[str] | None:
        """Return the parts of a frame that the outputs are made of besides parameters and inputs; None: all parts.

        The parts are the names of `frame.PARTS`. Where frames are reused, the pass runs only if one of them changed.
        """
        return None

    def frames_to_fill(self) -> int:
        """Return in how many frames of a still scene what the pass keeps from frame to frame becomes complete."""
        return 1

    def explain_unfilled(self, name: str, figures: Mapping[str, int], averaged: int) -> str | None:
        """Return what the last image lacks of what the pass completes over several frames, and the mend; else None.

        name: the pass's name in the graph. figures: what was published with the last frame, by name. averaged: frames
        in an image; each of several starts afresh.
        """
        del name, figures, averaged
        return None

    def explain_shared_error(self, facts: Facts, inputs: Mapping[str, Description | None]) -> str | None:
        """Return what the pass gets wrong in all frames alike, so that no mean of frames mends it; None for nothing.

        facts: what is known where the pass runs. inputs: descriptions, as for `outputs`.
        """
        del facts, inputs
        return None

    def subpasses(self, inputs: Mapping[str, Description | None], state: Any = None) -> Sequence[Mapping[str, Any]]:
        """Return the sub-passes that the pass plans for itself, one dictionary each, for those who read the plan.

        state: the pass's `State` after a frame; then the sub-passes are those of that frame.
        """
        del inputs, state
        return ()

    def execute(self, frame: Any, io: Any) -> None:
        """Do the work of one frame. frame: a `frame.Frame`; io: the pass's ports, a `pass_io.Io`."""
        raise NotImplementedError
